"""No more than so many requests a second to one host, whoever asks."""

import threading
import time
from urllib.parse import urlsplit


class RateLimit:
    """Spaces the requests of all threads to one host evenly."""

    def __init__(self, requests_per_s: float) -> None:
        self._spacing_s = 1.0 / requests_per_s
        self._next: dict[str, float] = {}
        self._lock = threading.Lock()

    def wait(self, url: str) -> None:
        """Return when the next request to the URL's host may be sent."""
        host = urlsplit(url).netloc
        with self._lock:
            now = time.monotonic()
            turn = max(now, self._next.get(host, now))
            self._next[host] = turn + self._spacing_s
        time.sleep(max(turn - now, 0.0))
