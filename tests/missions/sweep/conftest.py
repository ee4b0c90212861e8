"""Fixtures for tests of sweeps: a short mission, and policies that fail in different ways."""

from pathlib import Path

import pytest

from tests.envs.helpers import write_yard

POLICIES = """
import os, time

class Stands:
    def __init__(self, rng): pass
    def __call__(self, observation, findings, site_map): return [0.0, 0.0]

class Raises(Stands):
    def __call__(self, observation, findings, site_map): raise RuntimeError("out of ideas")

class Hangs(Stands):
    def __call__(self, observation, findings, site_map):
        open("hanging", "w").close()
        time.sleep(3600.0)

class Eats(Stands):
    def __call__(self, observation, findings, site_map):
        eaten = []
        while True:
            eaten.append(bytearray(10_000_000))

class Dies(Stands):
    def __call__(self, observation, findings, site_map):
        with open("deaths", "a") as file:
            file.write("died ")
        os._exit(7)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a scenario that ends after eight seconds, and policies that fail in different ways."""
    write_yard(tmp_path, "[task]\ntime_limit_s = 8.0", to="short")
    (tmp_path / "own.py").write_text(POLICIES, encoding="utf-8")
    return tmp_path
