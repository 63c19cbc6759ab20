"""The profiles that an ablation compares."""

from lab.evaluate.ablation import ablation


def test_each_profile_lacks_one_part_of_the_joint_estimator() -> None:
    profiles = {profile.name: profile for profile in ablation()}
    parts = ("one-law", "no-tiles", "no-psf", "no-bending", "no-priors")
    assert list(profiles) == ["paper", "joint", *(f"joint-{part}" for part in parts)]
    whole = profiles["joint"].resolved()
    for name in list(profiles)[2:]:
        other = profiles[name].resolved()
        changed = {key for key in other if other[key] != whole[key]} - {"name"}
        assert changed == {"joint"}
    assert profiles["joint-no-psf"].joint.hold == ("psf",)
    assert profiles["joint-no-priors"].joint.priors.file.range_sigma(1e5) == float("inf")
