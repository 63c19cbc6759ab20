"""Errors of the metadata: priors of a predicted pose, by where it comes from."""

from collections.abc import Mapping

import numpy as np
from pydantic import BaseModel, ConfigDict, Field


class PriorSettings(BaseModel):
    """1-sigma errors of the metadata; None leaves the unknown free."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    range_km: float | None = Field(20.0, gt=0, description="Error of the distance to the target's centre, kilometres.")
    range_share: float | None = Field(
        None, gt=0, description="The same as a share of the distance, for a pose of which nobody knows more."
    )
    roll_deg: float | None = Field(0.1, gt=0)
    attitude_deg: float | None = Field(1.0, gt=0)
    psf_relative: float | None = Field(0.25, gt=0)
    sun_deg: float = Field(
        0.0,
        ge=0,
        description="Error of the direction to the Sun, in the camera's frame, about each of two axes; 0: known.",
    )

    def range_sigma(self, range_km: float) -> float:
        """1-sigma of the logarithm of the range factor at a range: of kilometres and share both; inf where free."""
        parts = [self.range_km and self.range_km / range_km, self.range_share]
        known = [part for part in parts if part]
        return float(np.hypot.reduce(known)) if known else float("inf")


class SourcePriors(BaseModel):
    """Priors by where the predicted pose comes from: trajectories of kernels and labels are known to some ten
    kilometres, and so are those that ISDs and the tables of ISIS cubes hold, which were made from kernels; a pose file
    may hold anything. wcs, twist: orientations of FITS headers and Galileo's labels (four of its labels agree with
    their own north azimuth to 0.02 deg; headers' world coordinates are often rounded or approximate).
    image: of poses found in the image whose own errors are not at hand (each has its own, see `tasks.initial_pose`).
    unchecked_attitude_deg: the attitude of a pose file for a target without a map, whose markings cannot test it; None
    takes it for as good as any other file's."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    spice: PriorSettings = PriorSettings()
    label: PriorSettings = PriorSettings(range_km=50.0)
    isd: PriorSettings = PriorSettings()
    tables: PriorSettings = PriorSettings()
    pds4: PriorSettings = PriorSettings(range_km=50.0, roll_deg=0.3)
    wcs: PriorSettings = PriorSettings(roll_deg=0.3)
    twist: PriorSettings = PriorSettings(roll_deg=0.3)
    file: PriorSettings = PriorSettings(range_km=None, range_share=0.02, attitude_deg=3.0)
    image: PriorSettings = PriorSettings(range_km=None, range_share=0.02, attitude_deg=3.0)
    unchecked_attitude_deg: float | None = Field(30.0, gt=0)

    def of(
        self, sources: Mapping[str, str], has_map: bool = True, stated: Mapping[str, float] | None = None
    ) -> PriorSettings:
        """Each prior by where its part of the pose comes from (keys of `Pose`; the catalog's rotation models are those
        of kernels). has_map: whether the target's markings can test the attitude. stated: what a pose file states of
        its own parts (fields of `PriorSettings`), which is taken in place of what is assumed of pose files."""
        camera, position, body = (
            getattr(self, sources[part].replace("catalog", "spice"))
            for part in ("camera_from_j2000", "target_from_spacecraft_km", "body_from_j2000")
        )
        unchecked = self.unchecked_attitude_deg if sources["body_from_j2000"] == "file" else None
        assumed = PriorSettings(
            range_km=position.range_km,
            range_share=position.range_share,
            roll_deg=camera.roll_deg,
            attitude_deg=body.attitude_deg if has_map or not unchecked else unchecked,
            psf_relative=camera.psf_relative,
        )
        return assumed.model_copy(update=_replaced(stated or {}, sources))


def _replaced(stated: Mapping[str, float], sources: Mapping[str, str]) -> dict[str, float | None]:
    """The priors that a pose file's own errors replace: those of the parts that are the file's. Kilometres and share of
    a range are one error."""
    replaced: dict[str, float | None] = {}
    for names, part in (
        (("range_km", "range_share"), "target_from_spacecraft_km"),
        (("roll_deg",), "camera_from_j2000"),
        (("attitude_deg",), "body_from_j2000"),
    ):
        if sources[part] == "file" and any(name in stated for name in names):
            replaced |= {name: stated.get(name) for name in names}
    return replaced
