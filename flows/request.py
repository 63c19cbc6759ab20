"""What is asked for one image, and the inputs that follow from it before any work."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat, field_validator

from catalog.basemap import MAX_MAP_BYTES, NO_MAP, packaged_map_path
from catalog.body import MAX_SHAPE_BYTES
from catalog.camera import Camera, find_camera, known_cameras
from catalog.camera_store import camera_as_file
from catalog.digest import input_changed, sha256_of_file, sha256_of_json
from catalog.errors import RefusedError
from catalog.flips import Flip
from catalog.image_mode import Window
from catalog.made_camera import ISD, file_in, is_made
from catalog.mask import MAX_MASK_BYTES
from catalog.plain_text import is_text, shown_path
from catalog.readers import image_is_folder
from catalog.readers.reading import MAX_FILE_BYTES
from catalog.readers.stated_mode import MAX_SUMMING
from catalog.regular_file import MAX_TEXT_BYTES, ChangedError, TooLargeError
from catalog.safe_name import is_safe_product_name, safe_product_name
from catalog.settings import cache_folder, default_kernels
from catalog.spice import Kernel, list_kernels
from catalog.target import Target, find_target, further_targets, is_target_file, known_targets
from flows.defaults import DEFAULT_PROFILE
from flows.profile import Profile, find_profile, profile_of
from tasks.scene_inputs import UNIFORM, BaseMapInputs

LARGEST_BYTES = {
    "image": MAX_FILE_BYTES,
    "label": MAX_FILE_BYTES,
    "pose file": MAX_TEXT_BYTES,
    "mask": MAX_MASK_BYTES,
    "base map": MAX_MAP_BYTES,
    "shape": MAX_SHAPE_BYTES,
    "reseau table": MAX_TEXT_BYTES,
}


def _profile_by_name(profile: Any) -> Any:
    if isinstance(profile, dict):
        return profile_of(profile)
    return find_profile(profile) if isinstance(profile, str) else profile


NamedProfile = Annotated[Profile, BeforeValidator(_profile_by_name, json_schema_input_type=Profile | str)]


def _name_of_file(known: dict[str, Any]) -> str:
    return safe_product_name(Path(known["image"]).stem)


class Request(BaseModel):
    """One image to correct. product: its name, a plain folder name; the file's without suffix by default. camera,
    target, pose_file, basemap: override what the file says or does not say; None asks the file and the catalog, a
    basemap "none" takes none. shape: model that the cube's planes are projected on. kernels: files, folders or meta-
    kernels; None takes those of the environment. profile: its settings, or its name or file; settings build on the
    default profile as a file's do, and what it holds stays. start_offset_px: added to the predicted centre
    beforehand. mask: file whose non-zero pixels are not used. resume: an earlier result to start from, see
    `flows.guidance`. flip: how the picture is flipped before anything else. plane, summing, window: of the image,
    see `tasks.image_file.ImageInputs`. publish_to: URL of an object store that the product is copied to from
    `store`."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    image: Path
    product: str = Field(default_factory=_name_of_file)
    store: Path = Path("out")
    camera: str | None = None
    target: str | None = None
    pose_file: Path | None = None
    basemap: Path | None = None
    shape: Path | None = None
    map_left_edge_deg: float = Field(0.0, ge=-360, le=360)
    kernels: tuple[Path, ...] | None = None
    profile: NamedProfile = Field(default_factory=lambda: find_profile(DEFAULT_PROFILE))
    start_offset_px: tuple[FiniteFloat, FiniteFloat] | None = None
    mask: Path | None = None
    flip: Flip | None = None
    plane: str | None = None
    summing: int | None = Field(None, ge=1, le=MAX_SUMMING)
    window: Window | None = None
    resume: Path | None = None
    cache: Path = Field(default_factory=cache_folder)
    publish_to: str | None = None

    @field_validator("product")
    @classmethod
    def _is_a_folder_name(cls, name: str) -> str:
        if not is_safe_product_name(name):
            raise ValueError(f"{name!r} is no name for a folder in a store; {safe_product_name(name)!r} would be")
        return name

    @property
    def product_folder(self) -> Path:
        """Where the product is published."""
        return self.store / self.product

    @property
    def camera_name(self) -> str | None:
        """The camera's name or file; one that is made (from kernels, an ISD, a cube) is a file in the cache."""
        if self.camera is None or not is_made(self.camera):
            return self.camera
        return str(camera_as_file(self.camera, self.kernel_paths, self.cache / "cameras"))

    @property
    def pose_path(self) -> Path | None:
        """The pose file; for a camera from an ISD the ISD, which holds both."""
        is_isd = self.camera is not None and self.camera.lower().startswith(ISD)
        return file_in(str(self.camera)) if self.pose_file is None and is_isd else self.pose_file

    @property
    def kernel_paths(self) -> list[Path]:
        """The kernels to use."""
        return list(self.kernels) if self.kernels is not None else default_kernels()


def digest_of(path: Path, what: str) -> str:
    """Content hash of a file that the user named. Raises RefusedError when it cannot be read, has more bytes than what
    it is meant to be, or changes meanwhile."""
    code = what.replace(" ", "-")
    try:
        return sha256_of_file(path, LARGEST_BYTES.get(what))
    except FileNotFoundError as error:
        raise RefusedError(f"{code}-missing", f"{what} {path} does not exist.", "Check the path.") from error
    except TooLargeError as error:
        remedy = "Give a single frame." if what == "image" else "Is it the right file?"
        raise RefusedError(f"{code}-too-large", f"{what} {path}: {error.strerror}.", remedy) from error
    except ChangedError:
        raise input_changed(f"{what} {path}") from None
    except OSError as error:
        if what == "image" and isinstance(error, IsADirectoryError):
            raise image_is_folder(path) from error
        remedy = "Give a file that may be read; save what comes from a pipe as a file first."
        raise RefusedError(f"{code}-unreadable", f"{what} {path} cannot be read: {error.strerror}.", remedy) from error


def refuse_what_is_no_text(request: Request) -> None:
    """Raises RefusedError for a path with bytes that are no UTF-8: neither products nor Prefect could say them."""
    named = {"image": request.image, "store": request.store, "pose file": request.pose_file, "mask": request.mask}
    named |= {"base map": request.basemap, "shape model": request.shape, "resumed product": request.resume}
    named |= {"camera file": Path(request.camera) if request.camera else None, "cache": request.cache}
    named |= {f"kernel {number}": path for number, path in enumerate(request.kernel_paths, 1)}
    for what, path in named.items():
        if path is not None and not is_text(path):
            fault = f"the path of the {what}, {shown_path(path)}, is no UTF-8 text."
            raise RefusedError("name-not-text", fault, "Rename the file or folder, or make a link of another name.")


def camera_inputs(request: Request) -> Camera | str:
    """What the camera's name may turn into: the camera the user gave, else all cameras whose names labels may bear."""
    if request.camera is not None:
        return find_camera(str(request.camera_name))
    return camera_names_digest()


def target_inputs(request: Request) -> Target | str | None:
    """The target's name as the user gave it, or what the user's target file says; None leaves it to the label."""
    if request.target is None or not is_target_file(request.target):
        return request.target
    return find_target(request.target)


@cache
def camera_names_digest() -> str:
    """Content of the catalog's camera files, and of those of plugins, whose spellings labels are compared with."""
    return _digest_of(known_cameras())


@cache
def target_names_digest() -> str:
    """Content of the catalog's target files, and of those of plugins, whose spellings labels are compared with."""
    return _digest_of(known_targets() | further_targets())


def _digest_of(known: Mapping[str, BaseModel]) -> str:
    return sha256_of_json({name: each.model_dump(mode="json", exclude_unset=True) for name, each in known.items()})


class KernelLists:
    """Kernels as they are offered: a set is looked through once in the life of this, for all images of a list share a
    few sets."""

    def __init__(self) -> None:
        self._listed: dict[tuple[Path, ...], list[Kernel]] = {}

    def of(self, paths: list[Path]) -> list[Kernel]:
        """Every kernel offered, in the order of loading; of a meta-kernel also its members. Raises RefusedError as
        `list_kernels`."""
        key = tuple(paths)
        if key not in self._listed:
            self._listed[key] = list_kernels(paths)
        return self._listed[key]


def kernel_inputs(kernels: list[Kernel]) -> tuple[tuple[str, str], ...]:
    """Name and content hash of kernels."""
    return tuple((kernel.path.name, kernel.sha256) for kernel in kernels)


def projected_target(request: Request, target: Target) -> Target:
    """The target that planes are projected on: with the shape model, if the user gave one."""
    return target if request.shape is None else target.with_shape(request.shape)


def basemap_inputs(request: Request, target: Target) -> tuple[BaseMapInputs, Path | None]:
    """The base map as inputs, and its file (None: a body without a map, or --map none; it is rendered uniform)."""
    if str(request.basemap) == NO_MAP or (request.basemap is None and not target.basemap):
        return UNIFORM, None
    path = request.basemap or packaged_map_path(str(target.basemap))
    left_edge_deg = request.map_left_edge_deg if request.basemap else 0.0
    return BaseMapInputs(name=path.name, sha256=digest_of(path, "base map"), left_edge_deg=left_edge_deg), path
