"""Any body of a loaded PCK as a Target: radii and rotation constants out of SPICE's kernel pool."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path

from catalog.body import RotationModel, Target
from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.spice import kernel_pool


def target_from_pck(
    name_or_id: str, kernels: Iterable[Path], other_names: Sequence[str] = (), catalog: Sequence[str] = ()
) -> Target:
    """Target of a NAIF name or id from the PCKs among `kernels`: radii BODYnnn_RADII, frame IAU_NAME, rotation.

    other_names, catalog: what else a name may have meant, and bodies that are no news, for the remedy.
    Raises RefusedError when SPICE does not know the name or no PCK gives its radii; it lists the bodies that have them.
    """
    import spiceypy

    with kernel_pool(kernels):
        try:
            naif_id = spiceypy.bods2c(name_or_id)
        except spiceypy.NotFoundError:
            naif_id = None
        if naif_id is None or not spiceypy.bodfnd(naif_id, "RADII"):
            raise RefusedError(
                Reason.TARGET_UNKNOWN,
                f"target {name_or_id!r} is neither in the catalog nor in a loaded PCK.",
                _remedy(name_or_id, _bodies_with_radii(), other_names, catalog),
            )
        return _target(naif_id)


def _target(naif_id: int) -> Target:
    import spiceypy

    name = spiceypy.bodc2n(naif_id)
    a, b, c = spiceypy.bodvcd(naif_id, "RADII", 3)[1]
    frame = f"IAU_{name.upper().replace(' ', '_')}"
    return Target(
        name=name.lower(),
        naif_id=naif_id,
        radii_km=(a, b, c),
        body_frame=frame if spiceypy.namfrm(frame) else "",
        rotation=_rotation(naif_id),
        sources=("loaded PCK",),
    )


def _rotation(naif_id: int) -> RotationModel | None:
    pole_ra, pole_dec, meridian = (_constants(naif_id, key) for key in ("POLE_RA", "POLE_DEC", "PM"))
    if not (pole_ra and pole_dec and meridian):
        return None
    system = naif_id // 100 if 100 <= naif_id < 1000 else naif_id // 10000 if 10000 < naif_id < 100000 else naif_id
    flat = _constants(system, "NUT_PREC_ANGLES")
    degree = int(next(iter(_constants(system, "MAX_PHASE_DEGREE")), 1))  # of the angles' polynomials (pck00011: Mars)
    nutation = {part: _constants(naif_id, f"NUT_PREC_{part}") for part in ("RA", "DEC", "PM")}
    used = max(map(len, nutation.values()))
    return RotationModel(
        pole_ra_deg=pole_ra,
        pole_dec_deg=pole_dec,
        prime_meridian_deg=meridian,
        angles_deg=tuple(flat[at : at + degree + 1] for at in range(0, len(flat), degree + 1))[:used],
        nutation_ra_deg=nutation["RA"],
        nutation_dec_deg=nutation["DEC"],
        nutation_meridian_deg=nutation["PM"],
    )


def _constants(naif_id: int, key: str) -> tuple[float, ...]:
    import spiceypy

    name = f"BODY{naif_id}_{key}"
    try:
        return tuple(map(float, spiceypy.gdpool(name, 0, 100)))
    except spiceypy.NotFoundError:
        return ()


def _bodies_with_radii() -> list[str]:
    import spiceypy

    try:
        variables = spiceypy.gnpool("BODY*_RADII", 0, 1000)
    except spiceypy.NotFoundError:
        return []
    ids = sorted(int(variable[4:].split("_")[0]) for variable in variables)
    return [spiceypy.bodc2s(naif_id).lower() for naif_id in ids]


def _remedy(name: str, in_pck: list[str], other_names: Sequence[str], catalog: Sequence[str]) -> str:
    near = get_close_matches(name.lower(), {*other_names, *in_pck}, n=3)
    meant = f"Did you mean {' or '.join(near)}? " if near else ""
    others = [body for body in in_pck if body not in other_names]
    loaded = f"the loaded PCK has {len(others)} more bodies" if in_pck else "no PCK is loaded (--kernels)"
    more = ", and moons and small bodies without a map (`planetpose targets`)" if catalog else ""
    return f"{meant}Give the body in the picture (--target). The catalog has {', '.join(catalog)}{more}; {loaded}."
