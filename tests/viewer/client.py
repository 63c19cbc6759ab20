"""The viewer's application without a network, as tests use it."""

from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from viewer.app import build_app
from viewer.security import Access


def client_of(store: Path, **access: Any) -> tuple[TestClient, Access]:
    """A client of the application, and who may use it."""
    made = Access(**{"port": 8080, **access})
    client = TestClient(build_app(store, made), base_url="http://127.0.0.1:8080")
    return client, made
