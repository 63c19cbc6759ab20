"""What a file's label says otherwise than the user, whose values are used and who is warned."""

from collections.abc import Iterable

from catalog.camera import Camera, known_cameras
from catalog.readers.names import camera_of_names
from catalog.readers.reading import Reading


def overruled_label(reading: Reading, camera: Camera | None, target: str | None) -> tuple[str, ...]:
    """A sentence for each of the user's `camera` and `target` (None: the label's is used) that the label contradicts;
    none where it names no camera of the catalog, or no target."""
    found = []
    name = reading.camera or camera_of_names(reading.instrument_names)
    if camera and name and is_another_instrument(camera, name):
        found.append(f"the label says camera {name}, --camera {camera.name} is used")
    if target and reading.targets and target not in reading.targets:
        found.append(f"the label says target {' or '.join(reading.targets)}, --target {target} is used")
    return tuple(found)


def reminder(overruled: Iterable[str]) -> str:
    """What a remedy begins with where the user overruled the label: that comes before all other advice."""
    return "".join(f"First of all: {sentence}. " for sentence in overruled)


def is_another_instrument(camera: Camera, name: str) -> bool:
    """Whether `camera` claims to be another instrument than the catalog's camera `name`, which the label means. A
    refined file of the same instrument does not, nor does one that says nothing of where it belongs."""
    if camera.name == name or camera_of_names(camera.label_names) == name:
        return False
    if camera.name in known_cameras():
        return True
    label = known_cameras()[name]
    ids = ("naif_spacecraft_id", "naif_instrument_id")
    claims = [(getattr(camera, key), getattr(label, key)) for key in ids if getattr(camera, key) is not None]
    return any(own != labels for own, labels in claims)
