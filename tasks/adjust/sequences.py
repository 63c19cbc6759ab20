"""Images that belong together."""

from collections.abc import Sequence

from tasks.adjust.measurement import Measurement


def sequences_of(images: Sequence[Measurement], gap_s: float) -> list[list[int]]:
    """Positions of the images of each sequence: one camera, one target, neighbours in time at most `gap_s` apart."""
    order = sorted(
        range(len(images)), key=lambda i: (images[i].camera.name, images[i].target.name, images[i].predicted.et)
    )
    found: list[list[int]] = []
    for position in order:
        if found and _follows(images[found[-1][-1]], images[position], gap_s):
            found[-1].append(position)
        else:
            found.append([position])
    return found


def _follows(earlier: Measurement, later: Measurement, gap_s: float) -> bool:
    same = (earlier.camera.name, earlier.target.name) == (later.camera.name, later.target.name)
    return same and later.predicted.et - earlier.predicted.et <= gap_s
