//! The statements of a friction law, as data: the law is written once and rendered as C text and as an ONNX graph.
//!
//! A [`Program`] is a list of statements in the order of execution, and a result. An [`Expr`] reads inputs, the state and
//! named variables. A back end renders each operator. [`Program::without_unused`] removes what a model does not need, so that
//! the law and its terms may define common quantities freely.

use std::collections::HashSet;
use std::rc::Rc;

/// An expression. Clones share their content.
#[derive(Clone, Debug)]
pub struct Expr(pub Rc<Node>);

/// The root of an expression.
#[derive(Debug)]
pub enum Node {
    /// A constant.
    Number(f32),
    /// An input of the step, by its name.
    Input(&'static str),
    /// The time since the last step, s.
    Period,
    /// A field of the state: before the step, or after it if a statement has set it.
    State(&'static str),
    /// A variable that a statement defines.
    Variable(String),
    /// An operator with its operand.
    Unary(Unary, Expr),
    /// An operator with its operands.
    Binary(Binary, Expr, Expr),
    /// The second expression if the first is above 0, the third otherwise.
    IfPositive(Expr, Expr, Expr),
}

/// An operator with one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the operators have the names of their functions")]
pub enum Unary {
    Negative,
    Abs,
    /// -1, 0 or 1.
    Sign,
    Exp,
    Ln,
    Sin,
    Cos,
    Atan,
}

/// An operator with two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the operators have the names of their functions")]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Min,
    Max,
    Power,
}

impl Expr {
    fn new(node: Node) -> Self {
        Self(Rc::new(node))
    }
    pub(super) fn number(value: f32) -> Self {
        Self::new(Node::Number(value))
    }
    pub(super) fn input(name: &'static str) -> Self {
        Self::new(Node::Input(name))
    }
    pub(super) fn period() -> Self {
        Self::new(Node::Period)
    }
    /// Returns a field of the state.
    pub fn state(name: &'static str) -> Self {
        Self::new(Node::State(name))
    }
    fn unary(&self, operator: Unary) -> Self {
        Self::new(Node::Unary(operator, self.clone()))
    }
    fn binary(&self, operator: Binary, other: &Self) -> Self {
        Self::new(Node::Binary(operator, self.clone(), other.clone()))
    }
    pub(super) fn negative(&self) -> Self {
        self.unary(Unary::Negative)
    }
    pub(super) fn abs(&self) -> Self {
        self.unary(Unary::Abs)
    }
    pub(super) fn sign(&self) -> Self {
        self.unary(Unary::Sign)
    }
    pub(super) fn exp(&self) -> Self {
        self.unary(Unary::Exp)
    }
    pub(super) fn ln(&self) -> Self {
        self.unary(Unary::Ln)
    }
    pub(super) fn sin(&self) -> Self {
        self.unary(Unary::Sin)
    }
    pub(super) fn cos(&self) -> Self {
        self.unary(Unary::Cos)
    }
    pub(super) fn atan(&self) -> Self {
        self.unary(Unary::Atan)
    }
    pub(super) fn min(&self, other: &Self) -> Self {
        self.binary(Binary::Min, other)
    }
    pub(super) fn max(&self, other: &Self) -> Self {
        self.binary(Binary::Max, other)
    }
    pub(super) fn power(&self, exponent: &Self) -> Self {
        self.binary(Binary::Power, exponent)
    }
    /// Limits to `-bound..=bound`.
    pub(super) fn within(&self, bound: &Self) -> Self {
        bound.negative().binary(Binary::Max, &bound.min(self))
    }
    /// `positive` if `self` is above 0, `otherwise` if not.
    pub(super) fn if_positive(&self, positive: &Self, otherwise: &Self) -> Self {
        Self::new(Node::IfPositive(self.clone(), positive.clone(), otherwise.clone()))
    }

    /// Passes every node of the expression to `visit`, the operands first.
    fn visit(&self, visit: &mut impl FnMut(&Node)) {
        match &*self.0 {
            Node::Unary(_, a) => a.visit(visit),
            Node::Binary(_, a, b) => [a, b].into_iter().for_each(|operand| operand.visit(visit)),
            Node::IfPositive(a, b, c) => {
                [a, b, c].into_iter().for_each(|operand| operand.visit(visit));
            }
            Node::Number(_)
            | Node::Input(_)
            | Node::Period
            | Node::State(_)
            | Node::Variable(_) => {}
        }
        visit(&self.0);
    }
}

impl From<f32> for Expr {
    fn from(value: f32) -> Self {
        Self::number(value)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $binary:ident) => {
        impl<E: AsRef<Expr>> std::ops::$trait<E> for Expr {
            type Output = Expr;
            fn $method(self, other: E) -> Expr {
                self.binary(Binary::$binary, other.as_ref())
            }
        }
        impl<E: AsRef<Expr>> std::ops::$trait<E> for &Expr {
            type Output = Expr;
            fn $method(self, other: E) -> Expr {
                self.binary(Binary::$binary, other.as_ref())
            }
        }
    };
}

impl AsRef<Expr> for Expr {
    fn as_ref(&self) -> &Expr {
        self
    }
}

operator!(Add, add, Add);
operator!(Sub, sub, Subtract);
operator!(Mul, mul, Multiply);
operator!(Div, div, Divide);

/// What a statement does with its value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Defines a variable.
    Define(String),
    /// Adds to a variable.
    AddTo(String),
    /// Multiplies a variable.
    ScaleBy(String),
    /// Sets a field of the state.
    SetState(&'static str),
}

/// A statement.
#[derive(Clone, Debug)]
pub struct Statement {
    /// What happens with the value.
    pub action: Action,
    /// The value.
    pub value: Expr,
    /// Comment for the reader of the code.
    pub comment: Option<String>,
}

/// Statements in the order of execution, and a result.
#[derive(Clone, Debug, Default)]
pub struct Program {
    /// In the order of execution.
    pub statements: Vec<Statement>,
    /// The value of the whole program.
    pub result: Option<Expr>,
    comment: Option<String>,
}

impl Program {
    /// Writes a comment before the next statement.
    pub fn comment(&mut self, text: impl Into<String>) {
        self.comment = Some(text.into());
    }

    /// Drops a comment that no statement followed.
    pub fn end_comment(&mut self) {
        self.comment = None;
    }

    fn push(&mut self, action: Action, value: Expr) {
        let comment = self.comment.take();
        self.statements.push(Statement { action, value, comment });
    }

    /// Defines a variable and returns it. The name must be new.
    pub fn define(&mut self, name: impl Into<String>, value: Expr) -> Expr {
        let name = name.into();
        self.push(Action::Define(name.clone()), value);
        Expr::new(Node::Variable(name))
    }

    /// Adds to a variable, and defines it at the first call.
    pub fn add_to(&mut self, name: &str, variable: &mut Option<Expr>, value: Expr) {
        if variable.is_some() {
            self.push(Action::AddTo(name.into()), value);
        } else {
            *variable = Some(self.define(name, value));
        }
    }

    /// Multiplies a variable, and defines it at the first call.
    pub fn scale_by(&mut self, name: &str, variable: &mut Option<Expr>, value: Expr) {
        if variable.is_some() {
            self.push(Action::ScaleBy(name.into()), value);
        } else {
            *variable = Some(self.define(name, value));
        }
    }

    /// Sets a field of the state and returns its new value.
    pub fn set_state(&mut self, name: &'static str, value: Expr) -> Expr {
        self.push(Action::SetState(name), value);
        Expr::state(name)
    }

    /// Returns the program without the definitions that neither the result nor the state depends on.
    pub fn without_unused(mut self) -> Self {
        let mut needed: HashSet<String> = HashSet::new();
        let need = |value: &Expr, needed: &mut HashSet<String>| {
            value.visit(&mut |node| {
                if let Node::Variable(name) = node {
                    needed.insert(name.clone());
                }
            });
        };
        self.result.iter().for_each(|result| need(result, &mut needed));
        let mut kept = Vec::new();
        for statement in self.statements.into_iter().rev() {
            let is_kept = match &statement.action {
                Action::Define(name) | Action::AddTo(name) | Action::ScaleBy(name) => {
                    needed.contains(name)
                }
                Action::SetState(_) => true,
            };
            if is_kept {
                need(&statement.value, &mut needed);
                kept.push(statement);
            }
        }
        kept.reverse();
        self.statements = kept;
        self
    }

    fn visit(&self, visit: &mut impl FnMut(&Node)) {
        let values = self.statements.iter().map(|statement| &statement.value);
        values.chain(&self.result).for_each(|value| value.visit(visit));
    }

    /// Returns the inputs that the program reads, in the order of their first use.
    pub fn inputs(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        self.visit(&mut |node| {
            if let Node::Input(name) = node
                && !names.contains(name)
            {
                names.push(*name);
            }
        });
        names
    }

    /// Returns the fields of the state that the program reads or sets.
    pub fn state(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        let mut add = |name: &'static str| {
            if !names.contains(&name) {
                names.push(name);
            }
        };
        self.visit(&mut |node| {
            if let Node::State(name) = node {
                add(name);
            }
        });
        self.statements.iter().for_each(|statement| {
            if let Action::SetState(name) = statement.action {
                add(name);
            }
        });
        names
    }

    /// Returns true if the program reads the time since the last step.
    pub fn reads_period(&self) -> bool {
        let mut reads = false;
        self.visit(&mut |node| reads |= matches!(node, Node::Period));
        reads
    }

    /// Returns true if a statement changes this variable after its definition.
    pub fn changes(&self, name: &str) -> bool {
        self.statements.iter().any(|statement| match &statement.action {
            Action::AddTo(changed) | Action::ScaleBy(changed) => changed == name,
            Action::Define(_) | Action::SetState(_) => false,
        })
    }
}
