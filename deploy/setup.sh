#!/bin/sh
# Work pool, deployments and automations on the server at PREFECT_API_URL (with PREFECT_API_AUTH_STRING where it asks for
# one). Run it again after every change of prefect.yaml or automations.yaml; it can be run any number of times.
#
#   PLANETPOSE_HOME=... PLANETPOSE_IMAGES=... PLANETPOSE_STORE=... sh deploy/setup.sh
set -eu
cd "$(dirname "$0")/.."
: "${PREFECT_API_URL:?is the address of the server, e.g. http://127.0.0.1:4200/api}"
: "${PLANETPOSE_IMAGES:?is the image list, by name or file}"
: "${PLANETPOSE_STORE:?is where products go: a folder, or s3://bucket/prefix}"
export PLANETPOSE_HOME="${PLANETPOSE_HOME:-$PWD}"
export PLANETPOSE_RUNNER="${PLANETPOSE_RUNNER:-threads}"
export PLANETPOSE_TIMEZONE="${PLANETPOSE_TIMEZONE:-UTC}"
pool="${PLANETPOSE_POOL:-planetpose}"

prefect work-pool create "$pool" --type process --overwrite
# One run at a time: the nightly one and the monthly one would do the same images.
prefect work-pool set-concurrency-limit "$pool" "${PLANETPOSE_RUNS:-1}"
prefect --no-prompt deploy --prefect-file deploy/prefect.yaml --all
prefect --no-prompt automation delete planetpose-lost-runs >/dev/null 2>&1 || true
prefect automation create --from-file deploy/automations.yaml
