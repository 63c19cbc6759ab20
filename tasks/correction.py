"""What a correction step returns."""

from dataclasses import dataclass, field
from typing import Any

from catalog.pose import Pose

# In a correction's evidence: 1-sigma by the scatter of residuals alone, under the keys of `changed`. It tells when
# iterating is of no use any more; what is stated as uncertainty holds all errors, or is None where they are not known.
FORMAL = "formal"


@dataclass(frozen=True)
class Correction:
    """A better Pose, what changed, how sure, and the evidence.

    changed: for instance {"offset_px": [dx, dy]}. uncertainty: 1-sigma under the same keys, None where it
    is not calibrated against truth. evidence: plain JSON values
    (histories, counts, similarity before and after). converged: False is for the flow to judge.
    """

    step: str
    pose: Pose
    changed: dict[str, Any]
    uncertainty: dict[str, Any] = field(default_factory=dict)
    evidence: dict[str, Any] = field(default_factory=dict)
    converged: bool = True
