"""All that an image's steps depend on as one digest, found without the steps: by sizes and times of the files that the
request names, the program's code and data, and the options. An image whose digest is that of its last outcome is
unchanged, and its plan takes less than a millisecond; one with another digest is planned by the keys of its steps."""

import os
import time
from pathlib import Path

from catalog.detached import label_beside
from catalog.digest import SETTLED_NS, sha256_of_json, signature_of
from catalog.errors import PlanetposeError
from catalog.made_camera import is_made
from catalog.plugins import GROUPS, plugins_of
from catalog.spice import KernelLists, kernel_inputs
from flows import inputs
from flows.request import Request
from tasks.code_version import code_version, data_version
from tasks.registry import STEPS

# Where the request stands for other files than those that it names: then nothing is abbreviated.
FURTHER = ("resume", "mask", "shape", "stars")


class Fingerprints:
    """Digests of requests; what they share is looked at once in the life of this."""

    def __init__(self, kernels: KernelLists) -> None:
        self._kernels = kernels
        self._signatures: dict[Path, list[int]] = {}
        self._kernel_digests: dict[tuple[Path, ...], str] = {}
        self._profiles: dict[int, str] = {}
        self._shared = None if any(map(plugins_of, GROUPS)) else program_digest()

    def of(self, request: Request) -> str | None:
        """The digest; None where it would not hold all that the steps depend on, a file cannot be looked at, or the
        image changed just now: a change within the clock's grain would not show."""
        if self._shared is None or any(getattr(request, name) is not None for name in FURTHER):
            return None
        if request.camera is not None and is_made(request.camera):
            return None
        try:
            image = os.stat(request.image)
            if time.time_ns() - max(image.st_mtime_ns, image.st_ctime_ns) < SETTLED_NS:
                return None
            label = label_beside(request.image)
            seen: list[object] = [signature_of(image), str(label), signature_of(os.stat(label)) if label else None]
            seen += [self._signature(path) for path in request.named_files()]
            kernels = self._kernel_digest(request)
        except (OSError, ValueError, PlanetposeError):
            return None
        options = request.model_dump_json(exclude={"profile", "store", "cache", "kernels"})
        return sha256_of_json([self._shared, self._profile_digest(request), options, kernels, seen])

    def _signature(self, path: Path) -> list[int]:
        if path not in self._signatures:
            self._signatures[path] = list(signature_of(os.stat(path)))
        return self._signatures[path]

    def _kernel_digest(self, request: Request) -> str:
        paths = request.kernel_paths
        key = tuple(paths)
        if key not in self._kernel_digests:
            self._kernel_digests[key] = sha256_of_json([list(each) for each in kernel_inputs(self._kernels.of(paths))])
        return self._kernel_digests[key]

    def _profile_digest(self, request: Request) -> str:
        key = id(request.profile)  # one object for all images of a list that nobody helped
        if key not in self._profiles:
            self._profiles[key] = sha256_of_json(request.profile.resolved())
        return self._profiles[key]


def program_digest() -> str:
    """Of the code of all steps, and of the data that comes with it."""
    code = [inputs.verdict_version(), code_version("flows.trace"), *(step.code for step in STEPS)]
    return sha256_of_json([code, data_version()])
