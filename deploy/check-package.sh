#!/bin/bash
# Builds source distribution and wheel, installs the wheel with all that it needs into an empty environment, beside
# planetmapper and rms-oops, and corrects a small image there. Needs a network and some minutes.
#
#   deploy/check-package.sh [FOLDER]     both files are left in FOLDER (dist by default)
set -euo pipefail
project=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "${1:-dist}"
dist=$(cd "${1:-dist}" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python3 -m venv "$work/builder"
"$work/builder/bin/pip" install --quiet build
"$work/builder/bin/python" -m build --outdir "$dist" "$project"

python3 -m venv "$work/empty"
"$work/empty/bin/pip" install --quiet --constraint "$project/constraints.txt" "$dist"/planetpose-*.whl planetmapper rms-oops
"$work/empty/bin/pip" check
cd "$work"
"$work/empty/bin/planetpose" --version
"$work/empty/bin/planetpose" cameras
PYTHONPATH="$project/tests/flows" "$work/empty/bin/python" - <<'PYTHON'
from pathlib import Path

import oops
import planetmapper
from small_image import PLANTED_OFFSET_PX, write_small_archive

import planetpose

write_small_archive(Path())
result = planetpose.correct(
    "small.png", "out", camera="small.toml", target="europa", pose_file="pose.json", profile="quick.toml", kernels=()
)
print(result["status"], result["reason"], result["offset_px"], "planted:", PLANTED_OFFSET_PX)
assert result["status"] in ("ok", "doubtful")
assert max(abs(a - b) for a, b in zip(result["offset_px"], PLANTED_OFFSET_PX)) < 0.3
print("the package works in an empty environment beside", planetmapper.__name__, "and", oops.__name__)
PYTHON
