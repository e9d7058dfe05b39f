//! No code, only dependencies: the features of libraries that the packages `host-sim` and `friction-python` share.
//!
//! Cargo builds a library once for each set of features that the selected packages ask for. The first command selects
//! `host-sim`, and `pip install ./python` selects `friction-python`. A library low in the tree with other features, such as
//! `libc`, then builds nearly everything again. With this package both ask for the same set, and pip compiles only what is its
//! own. cargo-hakari writes such packages for whole workspaces; here six libraries suffice. `tests/tidy/features.py` compares
//! the features of both packages.
