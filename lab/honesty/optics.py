"""What happens to light between body and file: blur, smear, an optic that bends, a detector. Plain numpy."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lab.honesty.caster import Shift

Array = NDArray[np.float64]
LARGEST_KERNEL_PX = 40


@dataclass(frozen=True)
class Blur:
    """A point-spread function, symmetric about its centre. sigma_px: width of the Gaussian core along x (of y:
    sigma_px * ratio). wings: share of the light in a second Gaussian of wings_px. moffat: exponent of a Moffat profile
    of the core's full width at half maximum, in place of the Gaussian; None is Gaussian. smear_px, smear_deg: length
    and direction of an even trail, symmetric about mid-exposure."""

    sigma_px: float
    ratio: float = 1.0
    wings: float = 0.0
    wings_px: float = 5.0
    moffat: float | None = None
    smear_px: float = 0.0
    smear_deg: float = 0.0

    @property
    def reach_px(self) -> int:
        """Half the kernel's side."""
        widest = max(5 * self.sigma_px * max(self.ratio, 1.0), 4 * self.wings_px if self.wings else 0.0)
        tail = 14 * self.sigma_px if self.moffat else 0.0
        return min(int(np.ceil(max(widest, tail) + self.smear_px / 2)) + 1, LARGEST_KERNEL_PX)

    def kernel(self, oversample: int) -> Array:
        """The kernel, odd-sided, of sum 1, at `oversample` samples per pixel."""
        half = self.reach_px * oversample
        y, x = np.mgrid[-half : half + 1, -half : half + 1] / oversample
        core = np.zeros_like(x)
        steps = max(1, int(np.ceil(self.smear_px * oversample * 2)))
        along = (np.arange(steps) + 0.5) / steps - 0.5 if self.smear_px else np.zeros(1)
        cos, sin = np.cos(np.radians(self.smear_deg)), np.sin(np.radians(self.smear_deg))
        for place in along * self.smear_px:
            core += self._still(x - place * cos, y - place * sin)
        return np.asarray(core / core.sum())

    def _still(self, x: Array, y: Array) -> Array:
        square = (x / self.sigma_px) ** 2 + (y / (self.sigma_px * self.ratio)) ** 2
        if self.moffat is None:
            core = np.exp(-square / 2)
        else:
            half_width = np.sqrt(2 * np.log(2))
            core = (1 + square / half_width**2 * (2 ** (1 / self.moffat) - 1)) ** -self.moffat
        core = core / core.sum()
        if not self.wings:
            return np.asarray(core)
        wide = np.exp(-(x**2 + y**2) / (2 * self.wings_px**2))
        return np.asarray((1 - self.wings) * core + self.wings * wide / wide.sum())


def blurred(fine: NDArray[np.float32], blur: Blur, oversample: int) -> Array:
    """The picture in whole pixels: blurred, and every pixel the mean over its area."""
    from scipy.signal import fftconvolve

    spread = fftconvolve(fine, blur.kernel(oversample).astype(np.float32), mode="same")
    rows, columns = fine.shape[0] // oversample, fine.shape[1] // oversample
    return np.asarray(spread.reshape(rows, oversample, columns, oversample).mean(axis=(1, 3)), np.float64)


def bending(
    random: np.random.Generator, rms_px: float, centre_px: tuple[float, float], radius_px: float
) -> Shift | None:
    """A smooth displacement of length `rms_px` (RMS over a disk) whose mean is nothing there: waves of one to two
    diameters."""
    if rms_px == 0:
        return None
    length = radius_px * random.uniform(2.0, 4.0, size=(2, 3))
    angle, phase = random.uniform(0, 2 * np.pi, size=(2, 3)), random.uniform(0, 2 * np.pi, size=(2, 3))

    def waves(x: Array, y: Array) -> Array:
        u, v = (x - centre_px[0])[None, None], (y - centre_px[1])[None, None]
        run = np.cos(angle)[..., None] * u + np.sin(angle)[..., None] * v
        return np.asarray(np.sin(2 * np.pi * run / length[..., None] + phase[..., None]).sum(axis=1))

    r, t = radius_px * np.sqrt(random.uniform(size=2000)), random.uniform(0, 2 * np.pi, size=2000)
    inside = waves(centre_px[0] + r * np.cos(t), centre_px[1] + r * np.sin(t))
    mean = inside.mean(axis=1)
    scale = rms_px / float(np.sqrt(((inside - mean[:, None]) ** 2).sum(axis=0).mean()))

    def shift(x: Array, y: Array) -> tuple[Array, Array]:
        dx, dy = scale * (waves(x, y) - mean[:, None])
        return x - dx, y - dy

    return shift


@dataclass(frozen=True)
class Detector:
    """peak_dn: what the brightest hundredth of the picture would reach. full_dn: where it saturates. gamma: signal is
    proportional to light to this power. hot: share of pixels with a wrong, bright value."""

    peak_dn: float
    full_dn: float
    sky_dn: float = 20.0
    read_dn: float = 1.0
    gain_e_per_dn: float = 20.0
    relative: float = 0.004
    gamma: float = 1.0
    hot: float = 0.0

    def expose(self, light: Array, random: np.random.Generator) -> NDArray[np.int16]:
        """Raw values of a picture of light; noise of photons, of pixels' sensitivities and of the reading."""
        seen = light[light > 0.02 * light.max()] if light.max() > 0 else light
        level = float(np.percentile(seen, 99)) if seen.size and seen.max() > 0 else 1.0
        signal = self.peak_dn * np.clip(light / level, 0, None) ** self.gamma
        signal = signal * (1 + self.relative * random.normal(size=light.shape))
        electrons = random.poisson(np.clip(signal + self.sky_dn, 0, 1e6) * self.gain_e_per_dn)
        raw = electrons / self.gain_e_per_dn + random.normal(0, self.read_dn, light.shape)
        if self.hot:
            hot = random.uniform(size=light.shape) < self.hot
            raw[hot] = random.uniform(self.peak_dn / 2, self.full_dn, size=int(hot.sum()))
        return np.clip(np.round(raw), 0, self.full_dn).astype(np.int16)
