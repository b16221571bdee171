"""Derivatives that fall apart by event: P0 and Q0 of an event move its own rows, the parameters
move all rows.

A matrix of R rows and k + m E coordinates then has R (k + m) numbers that are not zero, its normal
equations E small blocks beside one of the parameters. Time and memory grow with the records, and
not with their number of events, too. The coordinates of an event are taken out of the others by
themselves (Frisch and Waugh 1933), and the blocks of the normal equations out of the parameters'
(Schur's complement).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.model.drive import Drive
from tractexp.noise.span import compute_basis, project_out


@dataclass(frozen=True, eq=False)
class SeparableColumns:
    """Coordinates of E events, each of which acts on the residuals of its own event only.

    One simulation moves a coordinate of every event at once and has the differences of all of them.

    Attributes
    ----------
    coordinates : (E, m) ints
        Their columns, m an event.
    rows : E arrays (R_e,) of ints
        The residuals of each event.
    """

    coordinates: np.ndarray
    rows: tuple[np.ndarray, ...]

    @classmethod
    def of_power(cls, drive: Drive, first: int | None) -> "SeparableColumns":
        """P0 and Q0 of each event, coordinates from `first` on in the order of the events; None
        where they are held.
        """
        index = np.arange(drive.measurements.size).reshape(drive.measurements.shape)
        rows = tuple(index[:, part].ravel() for part in drive.parts)
        count = 0 if first is None else 2
        return cls(
            (first or 0) + np.arange(count * drive.events).reshape(drive.events, count), rows
        )

    @property
    def count(self) -> int:
        """m, coordinates of each event."""
        return self.coordinates.shape[1]

    def find_shared_columns(self, size: int) -> np.ndarray:
        """The columns (k,) of `size` coordinates that act on all residuals.

        Examples
        --------
        >>> two = SeparableColumns(np.array([[2], [3]]), (np.arange(5), np.arange(5, 9)))
        >>> two.find_shared_columns(4).tolist(), two.moves(4).astype(int).tolist()
        ([0, 1], [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]])
        """
        shared = np.ones(size, dtype=bool)
        shared[self.coordinates] = False
        return np.flatnonzero(shared)

    def moves(self, size: int) -> np.ndarray:
        """Which of `size` coordinates move in each simulation, (k + m, size).

        The k shared ones come first, each by itself, then the m of all events at once.
        """
        shared = self.find_shared_columns(size)
        moves = np.zeros((len(shared) + self.count, size))
        moves[np.arange(len(shared)), shared] = 1
        for j, group in enumerate(self.coordinates.T, len(shared)):
            moves[j, group] = 1
        return moves


NOT_SEPARABLE = SeparableColumns(np.empty((0, 0), dtype=int), ())


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of residuals by shared coordinates, and by those of each event.

    Coordinates stand in this order: the k shared ones, then the m of each event.

    Attributes
    ----------
    columns : (k + m, R)
        By the shared coordinates, then by the m of each residual's own event.
    k : int
        Number of shared coordinates.
    rows : E arrays (R_e,) of ints
        The residuals of each event.
    """

    columns: np.ndarray
    k: int
    rows: tuple[np.ndarray, ...]

    @property
    def shared_columns(self) -> np.ndarray:
        """The derivatives (R, k) by the shared coordinates."""
        return self.columns[: self.k].T

    def own(self, event: int) -> np.ndarray:
        """The derivatives (R_e, m) of one event's residuals by its own coordinates."""
        return self.columns[self.k :, self.rows[event]].T

    def only(self, coordinates: np.ndarray) -> "Sensitivities":
        """The derivatives by the coordinates that a mask (k + m E,) has; of an event the others
        are zero.
        """
        own = self.columns[self.k :].copy()
        for rows, mine in zip(
            self.rows, coordinates[self.k :].reshape(len(self.rows), -1), strict=True
        ):
            own[np.ix_(~mine, rows)] = 0.0
        shared = self.columns[: self.k][coordinates[: self.k]]
        return replace(self, columns=np.concatenate([shared, own]), k=len(shared))

    def times(self, coefficients: np.ndarray) -> np.ndarray:
        """Changes (b, R) of the rows for changes (b, k + m E) of the coordinates."""
        changes = coefficients[:, : self.k] @ self.columns[: self.k]
        own = coefficients[:, self.k :].reshape(len(coefficients), len(self.rows), -1)
        for e, rows in enumerate(self.rows):
            changes[:, rows] += own[:, e] @ self.own(e).T
        return changes

    def fit(self, rows: np.ndarray) -> np.ndarray:
        """Changes (b, k + m E) of the coordinates whose changes of the rows are nearest to those of
        `rows` (b, R).
        """
        free = self._own_basis().without_own(self.columns[: self.k])
        shared = np.linalg.lstsq(free.T, rows.T, rcond=None)[0].T
        left = rows - shared @ self.columns[: self.k]
        own = [left[:, mine] @ np.linalg.pinv(self.own(e)).T for e, mine in enumerate(self.rows)]
        return np.concatenate([shared, *own], axis=1)

    @property
    def without_own(self) -> np.ndarray:
        """The derivatives (R, k) by the shared coordinates, less what each event's own do as
        well.
        """
        return self._own_basis().without_own(self.columns[: self.k]).T

    def basis(self, distinct: float = 0.0, least: float = 0.0) -> "SeparableBasis":
        """An orthonormal basis of the changes that the coordinates can make; `compute_basis` says
        what `distinct` and `least` leave out of it.
        """
        alone = self._own_basis(distinct, least)
        return replace(
            alone, shared=compute_basis(alone.without_own(self.columns[: self.k]), distinct, least)
        )

    def _own_basis(self, distinct: float = 0.0, least: float = 0.0) -> "SeparableBasis":
        """Bases of the columns that each event has for itself, beside none that are shared;
        directions below a share `distinct` of the largest, or below `least`, are left out.
        """
        own = tuple(compute_basis(self.own(e).T, distinct, least) for e in range(len(self.rows)))
        return SeparableBasis(np.empty((0, self.columns.shape[1])), own, self.rows)


@dataclass(frozen=True, eq=False)
class SeparableBasis:
    """Orthonormal rows.

    Attributes
    ----------
    shared : (k, R)
        Over the residuals of all events.
    own : E arrays (m, R_e)
        Of each event.
    rows : E arrays (R_e,) of ints
        The residuals of each event.
    """

    shared: np.ndarray
    own: tuple[np.ndarray, ...]
    rows: tuple[np.ndarray, ...]

    def without_own(self, rows: np.ndarray) -> np.ndarray:
        """Rows (b, R) less their part in the span of each event's own."""
        left = rows.copy()
        for basis, mine in zip(self.own, self.rows, strict=True):
            left[:, mine] = project_out(rows[:, mine], basis)
        return left

    def project_out(self, rows: np.ndarray) -> np.ndarray:
        """Rows (b, R) less their part in the span."""
        return project_out(self.without_own(rows), self.shared)

    def energy(self, rows: np.ndarray) -> np.ndarray:
        """Squares of what the span has of rows (b, R), (b,)."""
        energy = ((rows @ self.shared.T) ** 2).sum(axis=1)
        for basis, mine in zip(self.own, self.rows, strict=True):
            energy += ((rows[:, mine] @ basis.T) ** 2).sum(axis=1)
        return energy

    @property
    def leverage(self) -> np.ndarray:
        """The share (R,) of the variance of each residual that the span takes."""
        leverage = (self.shared**2).sum(axis=0)
        for basis, mine in zip(self.own, self.rows, strict=True):
            leverage[mine] += (basis**2).sum(axis=0)
        return leverage


@dataclass(frozen=True, eq=False)
class NormalMatrix:
    """Gauss-Newton matrices of n lanes, in blocks.

    Attributes
    ----------
    shared : (n, k, k)
        Of the shared coordinates.
    cross : (n, E, m, k)
        Of each event's own with the shared ones.
    own : (n, E, m, m)
        Of each event's own.
    positions : (k,) ints
        Columns of the shared coordinates.
    columns : SeparableColumns
        Those of the events' own.
    """

    shared: np.ndarray
    cross: np.ndarray
    own: np.ndarray
    positions: np.ndarray
    columns: SeparableColumns

    @property
    def diagonal(self) -> np.ndarray:
        """The diagonals (n, D) of the matrices."""
        whole = np.zeros((len(self.shared), len(self.positions) + self.columns.coordinates.size))
        whole[:, self.positions] = np.einsum("nkk->nk", self.shared)
        whole[:, self.columns.coordinates] = np.einsum("nemm->nem", self.own)
        return whole

    def solve(self, side: np.ndarray, kept: np.ndarray, added: Sequence[np.ndarray]) -> np.ndarray:
        """Solve for several damped steps of each lane.

        Parameters
        ----------
        side : (n, D)
            Right-hand sides.
        kept : (n, D) bools
            Coordinates that take part; rows and columns of the others are those of the diagonals
            alone.
        added : arrays (n, q, D)
            What is added to the diagonals, for q dampings.

        Returns
        -------
        (n, q, D) array
        """
        at = self.positions
        apart = self.columns.coordinates
        mask = kept[:, at]
        own_mask = kept[:, apart]
        A = self.shared * (mask[:, :, None] & mask[:, None, :])
        B = self.cross * (own_mask[:, :, :, None] & mask[:, None, None, :])
        C = self.own * (own_mask[:, :, :, None] & own_mask[:, :, None, :])
        A = A[:, None]
        C = C[:, None]
        for diagonals in added:
            A = A + np.eye(len(at)) * diagonals[:, :, None, at]
            C = C + np.eye(apart.shape[1]) * diagonals[:, :, apart][..., None, :]
        own_side = np.concatenate([B, side[:, apart][..., None]], axis=3)[:, None]
        own = np.linalg.solve(C, np.broadcast_to(own_side, (*C.shape[:-1], own_side.shape[-1])))
        taken = np.einsum("nemk,nqemj->nqkj", B, own)
        rest = side[:, None, at, None] - taken[..., -1:]
        solution = np.empty((*A.shape[:2], side.shape[1]))
        solution[:, :, at] = shared = np.linalg.solve(A - taken[..., :-1], rest)[..., 0]
        solution[:, :, apart] = own[..., -1] - np.einsum("nqemk,nqk->nqem", own[..., :-1], shared)
        return solution
