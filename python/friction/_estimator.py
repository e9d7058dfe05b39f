"""Base classes of an estimator: scikit-learn's, if it is installed.

Importing scikit-learn takes longer than all of this package. So only ``Model`` is imported late, with its base classes.
"""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

from ._errors import FrictionError


class _Parameters:
    """Access to the arguments of the constructor without scikit-learn."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Returns the arguments of the constructor by name, as scikit-learn does."""
        del deep
        return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

    def set_params(self, **params: Any) -> Any:
        """Sets arguments of the constructor and returns itself."""
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ValueError(f"unknown parameter {name}, expected one of {', '.join(known)}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> Any:
        raise NotImplementedError("scikit-learn is missing: pip install scikit-learn")


class _Unfitted(ValueError, AttributeError):
    """What scikit-learn's error derives from."""


if TYPE_CHECKING:

    class Regressor(_Parameters):
        """Base of ``Model``."""

    class _NotFitted(_Unfitted):
        pass

else:
    try:
        from sklearn.base import BaseEstimator, RegressorMixin
        from sklearn.exceptions import NotFittedError as _NotFitted

        class Regressor(RegressorMixin, BaseEstimator):
            """Base of ``Model`` with scikit-learn."""

    except ImportError:
        Regressor, _NotFitted = _Parameters, _Unfitted


class NotFittedError(FrictionError, _NotFitted):
    """A model without values; for scikit-learn its own ``NotFittedError``."""
