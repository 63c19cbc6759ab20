"""What many machines would do, computed from costs per image that were measured on one."""

from collections.abc import Mapping
from typing import Any

# Amazon's list prices of S3 Standard, us-east-1, in US dollars: per request, and per gigabyte and month.
WRITE_PRICE, READ_PRICE, STORAGE_PRICE = 0.005 / 1000, 0.0004 / 1000, 0.023
WRITES = ("PUT", "LIST", "POST")
# "Roughly 100-200 milliseconds" for small objects (Amazon S3 User Guide, performance design patterns).
LATENCY_S = 0.15
AT_ONCE = 16  # objects of a product that are written together


def projected(costs: Mapping[str, Any], machines: int, processors: int, image_s: float | None) -> dict[str, float]:
    """Images per hour and price of a million of them.

    costs: of `lab.scale.run.measure_costs`. processors: per machine, a worker each. image_s: processor seconds of the
    images themselves; None: of those that were measured. A worker's processor rests while it waits for S3. The command
    hands out images one after another: that is the second limit.
    """
    new = costs["new"]
    own_s = new["image_s"] if image_s is None else image_s
    overhead_s = new["worker_s"] - new["image_s"]
    requests = {name.partition(" ")[0]: n for name, n in new.items() if name.endswith(" requests")}
    objects = new["objects"]
    one_by_one = sum(requests.values()) - objects + objects / AT_ONCE
    worker_s = own_s + overhead_s + one_by_one * LATENCY_S
    by_workers, by_command = machines * processors * 3600 / worker_s, 3600 / new["command_s"]
    price = sum(n * (WRITE_PRICE if name in WRITES else READ_PRICE) for name, n in requests.items())
    return {
        "machines": machines,
        "processors per machine": processors,
        "processor s per image": round(own_s + overhead_s, 2),
        "requests per image": round(sum(requests.values()), 1),
        "s of waiting per image": round(one_by_one * LATENCY_S, 2),
        "images per hour, workers": round(by_workers),
        "images per hour, one command": round(by_command),
        "images per hour": round(min(by_workers, by_command)),
        "commands that keep all busy": round(by_workers / by_command + 0.5),
        "MB moved per image": round(new["bytes"] / 1e6, 2),
        "dollars of requests per million": round(price * 1e6),
    }
