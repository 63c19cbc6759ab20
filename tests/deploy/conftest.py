"""The small image of the flow tests serves here too; an S3 server."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "flows"))

BUCKET = "products"


@pytest.fixture(scope="session")
def s3_server() -> Iterator[str]:
    """Address of an S3 server of this process; one for all modules, for fsspec remembers it."""
    server = pytest.importorskip("moto.server")
    served = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    served.start()
    host, port = served.get_host_and_port()
    yield f"http://{host}:{port}"
    served.stop()


@pytest.fixture(scope="module")
def s3(s3_server: str) -> Iterator[str]:
    """The same; the environment names it as AWS' tools want."""
    with pytest.MonkeyPatch.context() as patch:
        for name in [name for name in os.environ if name.startswith("AWS_")]:
            patch.delenv(name)
        patch.setenv("AWS_ENDPOINT_URL", s3_server)
        patch.setenv("AWS_ACCESS_KEY_ID", "test")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "test")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        import boto3  # type: ignore[import-untyped]

        boto3.client("s3").create_bucket(Bucket=BUCKET)
        yield s3_server


@pytest.fixture
def url(s3: str, request: pytest.FixtureRequest) -> str:
    """A store of the test's own."""
    return f"s3://{BUCKET}/{abs(hash(request.node.name))}"
