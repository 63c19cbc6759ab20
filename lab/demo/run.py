"""The demo: simulate a small archive with planted errors, correct it, compare with what was planted."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from catalog.camera import find_camera
from catalog.pose import Pose
from catalog.target import find_target
from flows.progress import Reporter
from flows.request import Request
from lab.demo.archive import SimulatedImage, simulate_archive
from lab.demo.images import demo
from lab.simulate.plant import PoseError, pose_error

RunRequests = Callable[[list[Request], Reporter], list[dict[str, Any]]]


@dataclass(frozen=True)
class DemoRow:
    """One image of the demo. result: of the correction, as `--json` prints it. before, after: the predicted and the
    corrected pose minus the truth; after is None when there is no corrected pose."""

    simulated: SimulatedImage
    result: dict[str, Any]
    before: PoseError
    after: PoseError | None

    def to_dict(self) -> dict[str, Any]:
        """Planted, found and residual as plain values, with the paper's figures."""
        entry, result = self.simulated.entry, self.result
        kinds = ("offset_px", "range_factor", "attitude_deg")
        return {
            "product": entry.product,
            "camera": entry.camera,
            "status": result["status"],
            "reason": result["reason"],
            "planted": {kind: getattr(entry, kind) for kind in kinds},
            "found": {kind: result[kind] for kind in kinds},
            "error_before": asdict(self.before),
            "error_after": asdict(self.after) if self.after else None,
            "limb_rms_px": result["limb_rms_px"],
            "paper": {"offset_px_mean_largest": entry.paper_offset_px, "residual_px": demo().paper_residual_px},
            "cube": result["cube"],
            "overlay": result["overlay"],
        }


def run_demo(
    folder: Path, run: RunRequests, reporter: Reporter, products: tuple[str, ...] | None = None, **options: Any
) -> list[DemoRow]:
    """Write `folder`/archive and `folder`/products and return one row per image (all, or some `products`).

    run: does the requests; options: more fields of the requests, for example cache or profile.
    """
    archive = simulate_archive(folder / "archive", products)
    requests = [
        Request(image=each.image, store=folder / "products", pose_file=each.predicted, kernels=(), **options)
        for each in archive
    ]
    return [_row(each, result) for each, result in zip(archive, run(requests, reporter), strict=True)]


def _row(simulated: SimulatedImage, result: dict[str, Any]) -> DemoRow:
    from catalog.pose import read_pose_file

    camera, target = find_camera(simulated.entry.camera), find_target(demo().target)
    truth, predicted = (read_pose_file(path).completed() for path in (simulated.truth, simulated.predicted))
    corrected = Pose.from_dict(result["pose"]) if result["pose"] else None
    return DemoRow(
        simulated=simulated,
        result=result,
        before=pose_error(predicted, truth, camera, target),
        after=pose_error(corrected, truth, camera, target) if corrected else None,
    )
