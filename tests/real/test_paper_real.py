"""The report on real data: the published poses against kernels, the limb of a real product."""

from pathlib import Path
from typing import Any

import pytest
from real_bench import Bench

from catalog.errors import RefusedError
from lab.paper.published_geometry import neighbours, published_differences
from lab.simulate.europa57 import paper_images
from tasks.pictures.limb_profiles import compare_limbs
from tasks.pictures.product import read_product
from tasks.pictures.redraw import draw_limb
from tasks.publish.checksums import checksum_faults

pytestmark = pytest.mark.real

# Taken 3 s apart; see the notes on the data: corrections up to 1 deg apart.
NEIGHBOURS = ("LOR_0034930319", "LOR_0034930322")


def test_lorris_published_poses_have_spices_range_and_turns_about_the_pole(data_folder: Path) -> None:
    images = [paper_images()[name] for name in NEIGHBOURS]
    first, second = published_differences(images, [data_folder / "kernels"])
    (pair,) = neighbours([first, second])
    print(f"{pair.seconds:.1f} s apart: turns {first.turn_deg} and {second.turn_deg} deg, apart {pair.angle_deg:.2f}")
    for each in (first, second):
        assert each.range_factor == pytest.approx(1, abs=2e-6)
        assert each.direction_px == pytest.approx((0, 0), abs=0.1)
        assert not each.sun_in_east
        assert each.pointing_px is None  # no C-kernel
        assert any(text.startswith("CK") for text in each.missing)
    assert first.turn_in_body_deg == pytest.approx([0.04, 0.01, 0.65], abs=0.02)
    assert second.turn_in_body_deg == pytest.approx([0.17, 0.0, 1.67], abs=0.02)
    assert pair.angle_deg == pytest.approx(1.02, abs=0.02)


def test_pictures_of_the_limb_leave_the_product_sound(europa: dict[str, Any]) -> None:
    folder = Path(europa["cube"]).parent
    paths = draw_limb(folder)
    assert [path.name for path in paths] == [
        f"limb-{kind}.png" for kind in ("segments", "profiles", "derivatives", "shifts")
    ]
    assert checksum_faults(folder) == []


def test_a_product_is_not_drawn_with_another_map(europa: dict[str, Any], bench: Bench) -> None:
    with pytest.raises(RefusedError, match="was made with the base map"):
        read_product(Path(europa["cube"]).parent, bench.data / "maps" / "europa_4096_left180E.jpg")


def test_the_limb_of_a_product_is_the_one_that_its_result_tells(europa: dict[str, Any], bench: Bench) -> None:
    found = compare_limbs(read_product(Path(europa["cube"]).parent))
    assert found.before is not None
    assert found.before.rms_px is not None
    print(f"limb rms {found.before.rms_px:.2f} -> {found.after.rms_px:.3f} px of {len(found.after.shift_px)} segments")
    assert found.after.rms_px == pytest.approx(europa["limb_rms_px"], abs=0.005)
    assert len(found.after.shift_px) == pytest.approx(europa["limb_points"], abs=3)
    assert found.before.rms_px > 5
