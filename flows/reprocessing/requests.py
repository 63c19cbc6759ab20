"""The requests of an image list."""

from collections.abc import Iterable
from pathlib import Path

from catalog.basemap import NO_MAP
from catalog.errors import RefusedError
from catalog.lists import load_image_list
from catalog.lists.model import ImageEntry, ImageList
from catalog.made_camera import file_in, is_made
from catalog.target import is_target_file
from flows.profile import Profile, find_profile
from flows.reprocessing.settings import Settings
from flows.request import Request


def requests_of(settings: Settings) -> list[Request]:
    """One request per image of the list, in its order. Raises RefusedError when list or profile are unknown, or no
    product matches `only`."""
    found, profile = listed(settings), find_profile(settings.profile)
    return [request_of(found, entry, settings, profile) for entry in found.entries]


def listed(settings: Settings) -> ImageList:
    """The image list, or those of it that match `only`. Raises RefusedError as `requests_of`."""
    found = load_image_list(settings.images)
    if not settings.only:
        return found
    chosen = found.only(settings.only)
    if not chosen.entries:
        raise RefusedError(
            "nothing-to-reprocess",
            f"no product of {settings.images} matches {', '.join(settings.only)}.",
            "See `planetpose catalog show LIST`.",
        )
    return chosen


def request_of(image_list: ImageList, entry: ImageEntry, settings: Settings, profile: Profile) -> Request:
    """What is asked for one image of a list."""

    def here(text: str | None) -> Path | None:
        return image_list.located(text, settings.archive) if text else None

    camera = entry.camera
    if camera and camera.endswith(".toml"):
        camera = str(image_list.located(camera, settings.archive))
    if camera and is_made(camera) and (file := file_in(camera)):
        camera = f"{camera.partition(':')[0]}:{image_list.located(str(file), settings.archive)}"
    target = entry.target
    if target and is_target_file(target):
        target = str(image_list.located(target, settings.archive))
    return Request(
        image=image_list.located(entry.image, settings.archive),
        product=entry.product,
        store=settings.store,
        publish_to=settings.publish_to,
        camera=camera,
        target=target,
        pose_file=here(entry.pose_file),
        basemap=Path(NO_MAP) if entry.basemap == NO_MAP else here(entry.basemap),
        map_left_edge_deg=entry.map_left_edge_deg,
        flip=entry.flip,
        plane=entry.plane,
        summing=entry.summing,
        window=entry.window,
        kernels=image_list.kernel_paths(entry, settings.archive) or settings.kernels,
        profile=profile,
        cache=settings.cache,
    )


def absolute(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Paths that mean the same in every process."""
    return tuple(path.expanduser().absolute() for path in paths)
