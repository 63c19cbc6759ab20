"""What is in deploy/: every file is what its reader takes, and asks for nothing that the program has not."""

import inspect
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
MANIFESTS = sorted((DEPLOY / "kubernetes").glob("*.yaml"))
UNITS = sorted((DEPLOY / "systemd").glob("planetpose-*.*"))
KUBERNETES = "1.31"
SETTINGS = sorted(path for path in DEPLOY.rglob("*") if path.is_file() and path.suffix not in (".md", ".pyc"))


def objects_in(path: Path) -> list[dict[str, Any]]:
    return [found for found in yaml.safe_load_all(path.read_text()) if found]


def compose() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
    return content


@pytest.mark.parametrize("deployment", yaml.safe_load((DEPLOY / "prefect.yaml").read_text())["deployments"], ids=str)
def test_deployments_name_flows_and_parameters_that_exist(deployment: dict[str, Any]) -> None:
    path, _, name = deployment["entrypoint"].partition(":")
    namespace: dict[str, Any] = {}
    exec(f"from {path.removesuffix('.py').replace('/', '.')} import {name}", namespace)
    known = inspect.signature(namespace[name].fn).parameters
    assert deployment["parameters"].keys() <= known.keys()
    required = {key for key, value in known.items() if value.default is inspect.Parameter.empty}
    assert required <= deployment["parameters"].keys()


def test_only_the_server_is_published_and_on_this_machine_alone() -> None:
    published = {name: service["ports"] for name, service in compose()["services"].items() if "ports" in service}
    assert published == {"server": ["${SERVER_ADDRESS:-127.0.0.1}:${SERVER_PORT:-4200}:4200"]}
    assert compose()["networks"]["inside"] == {"internal": True}
    for name in ("database", "scheduler"):
        assert compose()["services"][name]["networks"] == ["inside"]


@pytest.mark.parametrize("path", SETTINGS, ids=lambda path: path.name)
def test_no_secret_is_in_a_file(path: Path) -> None:
    secret = re.compile(r"(password|secret_access_key|secret-access-key|auth_string)\W*[:=]\s*[\"']?([^\s\"'#]+)", re.I)
    reported = [match.group(2) for match in secret.finditer(path.read_text()) if "example" not in path.name]
    assert [text for text in reported if not text.startswith(("${", "{", "$", "PASSWORD"))] == []


def test_a_variable_of_the_compose_file_is_in_the_example_or_has_a_default() -> None:
    requested = set(re.findall(r"\$\{(\w+):\?", (DEPLOY / "compose.yaml").read_text()))
    offered = set(re.findall(r"^(\w+)=", (DEPLOY / "example.env").read_text(), re.M))
    assert requested <= offered
    assert requested >= {"POSTGRES_PASSWORD", "PREFECT_AUTH_STRING"}


def test_the_image_runs_as_nobody_in_particular_and_copies_what_exists() -> None:
    text = (DEPLOY / "Dockerfile").read_text()
    assert re.findall(r"^USER (.*)", text, re.M) == ["10001:10001"]
    sources = [name for line in re.findall(r"^COPY (.*)", text, re.M) for name in line.split()[:-1]]
    assert [name for name in sources if not (ROOT / name).exists()] == []
    let_in = {line[1:] for line in (DEPLOY / "Dockerfile.dockerignore").read_text().split() if line.startswith("!")}
    assert set(sources) <= let_in
    assert "constraints.txt" in text


@pytest.mark.parametrize(
    "path", [path for path in MANIFESTS if path.name != "kustomization.yaml"], ids=lambda p: p.name
)
def test_manifests_are_what_kubernetes_takes(path: Path) -> None:
    validate = pytest.importorskip("kubernetes_validate").validate
    for manifest in objects_in(path):
        validate(manifest, KUBERNETES, strict=True)


def test_kustomization_names_every_manifest_but_the_template_of_the_secret() -> None:
    (kustomization,) = objects_in(DEPLOY / "kubernetes" / "kustomization.yaml")
    named = set(kustomization["resources"])
    assert named == {path.name for path in MANIFESTS} - {"kustomization.yaml", "secret.example.yaml"}


def test_pods_are_restricted_and_take_secrets_from_the_secret_alone() -> None:
    pods = [
        manifest["spec"]["template"]["spec"]
        for path in MANIFESTS
        for manifest in objects_in(path)
        if "template" in manifest.get("spec", {})
    ]
    assert len(pods) == 6
    (secret,) = objects_in(DEPLOY / "kubernetes" / "secret.example.yaml")
    for pod in pods:
        assert pod["securityContext"]["runAsNonRoot"] is True
        for container in pod["containers"]:
            assert container["securityContext"] == {
                "allowPrivilegeEscalation": False,
                "capabilities": {"drop": ["ALL"]},
            }
            assert "limits" in container["resources"]
            for variable in container.get("env", []):
                if re.search(r"PASSWORD|SECRET|AUTH_STRING|ACCESS_KEY", variable["name"]):
                    assert variable["valueFrom"]["secretKeyRef"]["key"] in secret["stringData"], variable["name"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_units_are_what_systemd_takes(tmp_path: Path) -> None:
    programs = str(Path(sys.executable).parent)
    for unit in UNITS:
        (tmp_path / unit.name).write_text(unit.read_text().replace("/opt/planetpose/.venv/bin", programs))
    command = ["systemd-analyze", "verify", *(str(tmp_path / unit.name) for unit in UNITS)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    complaints = [line for line in done.stderr.splitlines() if "planetpose" in line]
    assert complaints == []


def test_the_set_up_is_a_script_that_shells_take_and_says_what_is_missing() -> None:
    subprocess.run(["sh", "-n", str(DEPLOY / "setup.sh")], check=True)
    done = subprocess.run(
        ["sh", str(DEPLOY / "setup.sh")], env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "PREFECT_API_URL" in done.stderr
