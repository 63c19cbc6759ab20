"""A star catalog as the search for stars needs it: some stars around a direction, or the brighter ones of all."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from catalog.stars.embedded import embedded_stars
from catalog.stars.table import StarTable


@dataclass(frozen=True)
class Cone:
    """Directions no farther than `radius_deg` from an axis (3,), a unit vector."""

    axis: NDArray[np.float64]
    radius_deg: float


class StarCatalog(Protocol):
    """Where stars come from."""

    @property
    def name(self) -> str:
        """Name of the catalog, for the result."""
        ...

    def stars(self, cone: Cone | None = None) -> StarTable:
        """Stars within a cone, of all directions without one; brightest first."""
        ...


@dataclass(frozen=True)
class EmbeddedCatalog:
    """A catalog that comes as a package (`catalog.stars.embedded`)."""

    key: str

    @property
    def name(self) -> str:
        """Name of the catalog."""
        return embedded_stars(self.key).name

    def stars(self, cone: Cone | None = None) -> StarTable:
        """Stars within a cone, or all; brightest first."""
        table = embedded_stars(self.key)
        return table if cone is None else table.within(cone.axis, cone.radius_deg)
