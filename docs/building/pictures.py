"""The pictures of the documentation, from products: `python -m building.pictures SIMULATED REAL` in the folder docs.

SIMULATED: the product of C2062524 of `planetpose simulate europa57 --seed 1`, REAL: that of C0552809300R, each after
`planetpose show PRODUCT --all`. They are brought to few colours, so that they stay small.
"""

import sys
from pathlib import Path

COLOURS = 200
WIDEST_PX = 760
FOLDER = Path(__file__).resolve().parents[1] / "_static"
PICTURES = {
    "simulated": ("overlay", "planes"),
    "europa": ("overlay", "planes", "residual"),
}


def write_small(source: Path, to: Path) -> None:
    """Write a picture with few colours."""
    from PIL import Image

    picture = Image.open(source).convert("RGB")
    if picture.height > picture.width:
        picture.thumbnail((WIDEST_PX, WIDEST_PX), Image.Resampling.LANCZOS)
    picture.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(to, optimize=True)


def main() -> None:
    """Write all pictures."""
    for product, (name, pictures) in zip(map(Path, sys.argv[1:3]), PICTURES.items(), strict=True):
        for picture in pictures:
            write_small(product / f"{picture}.png", FOLDER / f"{name}-{picture}.png")


if __name__ == "__main__":
    main()
