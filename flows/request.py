"""The request for one image, and the inputs that follow from it before any work."""

import os
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, field_validator

from catalog.basemap import NO_MAP, packaged_map_path
from catalog.camera import Camera, find_camera
from catalog.camera_store import camera_as_file
from catalog.errors import RefusedError
from catalog.fetch.addresses import Addresses
from catalog.input_file import digest_of
from catalog.made_camera import ISD, file_in, is_made
from catalog.names_digest import camera_names_digest
from catalog.plain_text import is_text, shown_path
from catalog.pose import IN_IMAGE
from catalog.safe_name import is_safe_product_name, safe_product_name
from catalog.settings import DEFAULT_PROFILE, cache_folder, default_kernels, shared_cache_url
from catalog.target import Target, find_target, is_target_file
from flows.image_options import ImageOptions
from tasks.profile import Profile, find_profile, profile_of
from tasks.scene_inputs import UNIFORM, BaseMapInputs


def _profile_by_name(profile: Any) -> Any:
    if isinstance(profile, dict):
        return profile_of(profile)
    return find_profile(profile) if isinstance(profile, str) else profile


NamedProfile = Annotated[Profile, BeforeValidator(_profile_by_name, json_schema_input_type=Profile | str)]


def _name_of_file(known: dict[str, Any]) -> str:
    return safe_product_name(Path(known["image"]).stem)


class Request(ImageOptions):
    """One image to correct. product: its name, a plain folder name; the file's without suffix by default. None of
    camera, target, pose_file or basemap leaves it to the file and the catalog, a basemap "none" takes none, a pose file
    "image" stands for a pose that is found in the image itself. kernels:
    files, folders or meta-kernels; None takes those of the environment. profile: its settings, or its name or file;
    settings build on the default profile as a file's do, and what it holds stays. resume: see `catalog.resumed`.
    publish_to: URL of an object store that the product is copied to from `store`. shared_cache: URL of results of steps
    that several machines share. addresses: of the files that are fetched when they are needed."""

    image: Path
    product: str = Field(default_factory=_name_of_file)
    store: Path = Path("out")
    kernels: tuple[Path, ...] | None = None
    profile: NamedProfile = Field(default_factory=lambda: find_profile(DEFAULT_PROFILE))
    cache: Path = Field(default_factory=cache_folder)
    publish_to: str | None = None
    shared_cache: str | None = Field(default_factory=shared_cache_url)
    addresses: Addresses | None = None

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
    def image_place(self) -> Path | str:
        """The image as people know it: its address, or its file."""
        return (self.addresses and self.addresses.of(self.image)) or self.image

    def named_files(self) -> list[Path]:
        """Files that are named beside the image, as far as they are there."""
        named = (self.pose_file, self.basemap, self.camera, self.target, self.resume, self.mask, self.shape, self.stars)
        options = [str(each) for each in named if each is not None and str(each) not in (IN_IMAGE, NO_MAP)]
        return [Path(each) for each in options if os.path.isfile(each)]

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
    def pose_is_in_image(self) -> bool:
        """Whether the pose is to be found in the image itself."""
        return str(self.pose_file) == IN_IMAGE

    @property
    def kernel_paths(self) -> list[Path]:
        """The kernels to use."""
        return list(self.kernels) if self.kernels is not None else default_kernels()


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


def guidance_of(request: Request) -> dict[str, Any]:
    """How the user helped or overruled the corrections, as the result has it: plain JSON, None or empty where it was
    not used."""
    return {
        "start_offset_px": list(request.start_offset_px) if request.start_offset_px else None,
        "held": list(request.profile.hold),
        "mask": shown_path(request.mask) if request.mask else None,
        "bodies": list(request.body),
        "flip": request.flip,
        "plane": request.plane,
        "summing": request.summing,
        "window": list(request.window) if request.window else None,
        "resumed_from": shown_path(request.resume) if request.resume else None,
    }


def is_started_elsewhere(request: Request) -> bool:
    """Whether the corrections start from another pose than the predicted one."""
    return request.start_offset_px is not None or request.resume is not None
