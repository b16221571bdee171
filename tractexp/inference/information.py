"""What the records say about each parameter: the information matrix, its directions, and the
intervals it gives.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# of the largest singular value: below it a direction changes nothing, whatever the noise
STRUCTURAL = 1e-6
# standard deviations per range: what is not known even to a million ranges changes nothing
BLIND = 1e-6
# of a parameter of which nothing is known but its range: a flat distribution has it
UNIFORM_PRECISION = 12.0
SHARE = 0.02  # of a direction's largest component: smaller ones do not take part in it


@dataclass(frozen=True, eq=False)
class Information:
    """What the records say about d parameters.

    Attributes
    ----------
    names : tuple of str
        Of the parameters.
    values : (d,)
        Their values, in physical units.
    width : (d,)
        Their ranges, in physical units.
    J : (R, d)
        Whitened sensitivities, per range of each parameter, nuisances projected out.
    structural : float
        A direction whose singular value is below this share of the largest changes nothing.
    held : tuple of str
        Parameters that cannot move to either side: a requirement of the model holds them.

    Examples
    --------
    Two parameters of which the records see only the sum:

    >>> J = np.ones((100, 2))
    >>> both = Information(("X", "X_prime"), np.ones(2), np.ones(2), J)
    >>> both.identifiable.tolist(), np.abs(both.unseen).round(6).tolist()
    ([False, False], [[1.0, 1.0]])
    """

    names: tuple[str, ...]
    values: np.ndarray
    width: np.ndarray
    J: np.ndarray
    structural: float = STRUCTURAL
    # those that cannot move to either side: a requirement of the model holds them
    held: tuple[str, ...] = ()

    @classmethod
    def from_jacobian(
        cls,
        names: Sequence[str],
        values: np.ndarray,
        width: np.ndarray,
        jacobian: np.ndarray,
        nuisances: np.ndarray,
    ) -> "Information":
        """The information that sensitivities hold, nuisances left free beside them.

        Parameters
        ----------
        names : names
            Of the d parameters.
        values, width : (d,)
            Physical values, and the ranges of their boxes.
        jacobian : (R, d)
            Whitened sensitivities, per range of each parameter.
        nuisances : (R, k)
            Those to what is left free; columns of zeros do not count.

        Returns
        -------
        Information
        """
        active = nuisances[:, np.any(nuisances != 0, axis=0)]
        basis, _ = np.linalg.qr(active)
        return cls(tuple(names), values, width, jacobian - basis @ (basis.T @ jacobian))

    @functools.cached_property
    def _directions(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Directions in ranges: those that the records see, over their singular values, and those
        they do not; and which parameters (d,) change nothing by themselves.
        """
        size = np.linalg.norm(self.J, axis=0)
        scale = np.where(size > 0, size, 1.0)
        _, singular, directions = np.linalg.svd(self.J / scale, full_matrices=False)
        seen = singular > self.structural * singular.max(initial=0.0)
        directions = directions / scale
        return directions[seen] / singular[seen, None], directions[~seen], size == 0

    @property
    def blind(self) -> tuple[str, ...]:
        """The names of the parameters that change nothing by themselves."""
        return tuple(
            name for name, blind in zip(self.names, self._directions[2], strict=True) if blind
        )

    def find_steps(self, rows: np.ndarray) -> np.ndarray:
        """The changes of the parameters that come nearest to changes of the rows.

        Parameters
        ----------
        rows : (b, R)
            Changes of whitened rows.

        Returns
        -------
        (b, d) array
            In physical units, along the directions that the records see.
        """
        seen = self._directions[0]
        return rows @ self.J @ seen.T @ seen * self.width

    @property
    def covariance(self) -> np.ndarray:
        """The covariance (d, d) in physical units, of the directions that the records see; `unseen`
        tells the others.
        """
        scaled = self._directions[0] * self.width
        return scaled.T @ scaled

    @property
    def unseen(self) -> np.ndarray:
        """Directions that change nothing, as relative changes (d value / value), made sparse.

        Returns
        -------
        (k, d) array
            Each scaled to a largest component of 1. Where a value is 0 the change is in ranges.
        """
        _, null, blind = self._directions
        null = null * self.width / np.where(self.values == 0, self.width, self.values)
        alone = np.eye(len(self.names))[blind]
        null = null * ~blind
        return _reduce_to_echelon(np.concatenate((alone, null[np.any(null != 0, axis=1)])))

    @property
    def identifiable(self) -> np.ndarray:
        """Which parameters (d,) take part in no direction that changes nothing."""
        return ~np.any(np.abs(self.unseen) > SHARE, axis=0)

    @property
    def standard_errors(self) -> np.ndarray:
        """The standard errors (d,) in physical units; inf for a parameter that cannot be
        identified.
        """
        return np.where(self.identifiable, np.sqrt(np.diag(self.covariance)), np.inf)

    @property
    def correlation(self) -> np.ndarray:
        """The correlation matrix (d, d) of the directions that the records see."""
        covariance = self.covariance
        size = np.sqrt(np.diag(covariance))
        outer = np.outer(size, size)
        return np.divide(covariance, outer, out=np.eye(len(size)), where=outer > 0).clip(-1.0, 1.0)

    def relative_error(self, exponents: np.ndarray) -> float:
        """The standard error of a product of powers of the parameters, relative.

        Parameters
        ----------
        exponents : (d,)
            log(prod value^exponent) is what has this standard error.

        Returns
        -------
        float
        """
        slope = exponents / np.where(self.values == 0, 1.0, self.values)
        return float(np.sqrt(slope @ self.covariance @ slope))


def compute_free_standard_errors(root: np.ndarray) -> np.ndarray:
    """The standard error of each coordinate, all others free.

    Parameters
    ----------
    root : (R, d)
        Rows whose inverse products are the covariance: whitened sensitivities, or what stands for
        them.

    Returns
    -------
    (d,) array
        In ranges; inf of a coordinate that changes nothing.

    Examples
    --------
    >>> compute_free_standard_errors(np.array([[2.0, 0.0], [0.0, 0.0]])).tolist()
    [0.5, inf]
    """
    seen = np.where(np.linalg.norm(root, axis=0) > BLIND, root, 0.0)
    ranges = np.ones(root.shape[1])
    names = tuple(str(k) for k in range(len(ranges)))
    return Information(names, 0 * ranges, ranges, seen).standard_errors


def _reduce_to_echelon(rows: np.ndarray) -> np.ndarray:
    """The reduced row echelon form by full pivoting: the same row space with as many zeros as it
    allows.
    """
    rows = rows.copy()
    done = 0
    used: list[int] = []
    while done < len(rows):
        open_ = np.abs(rows[done:])
        open_[:, used] = 0.0
        i, j = map(int, np.unravel_index(open_.argmax(), open_.shape))
        if open_[i, j] < 1e-9:
            break
        rows[[done, done + i]] = rows[[done + i, done]]
        rows[done] /= rows[done, j]
        others = np.arange(len(rows)) != done
        rows[others] -= rows[others, j, None] * rows[done]
        used.append(j)
        done += 1
    rows = rows[:done]
    largest = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    return np.where(np.abs(rows) < 1e-4 * largest, 0.0, rows) / np.where(largest > 0, largest, 1.0)
