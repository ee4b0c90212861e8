"""A learned baseline: PPO finds its way to the source in an open yard, from bearings and lidar.

`uv run --extra rl python -m pdpatrol.missions.learning` trains it, and puts it beside the
hand-written policies. With seed 0, in yards that training never saw:

| policy | reached the source | median time |
|---|---|---|
| PPO after 303 104 steps | 200 of 200 | 22.0 s |
| by hand, towards the last bearing | 200 of 200 | 21.9 s |
| random | 11 of 200, beside 5 of which it stood at the start | 0.3 s |
| `seek`, which also locates | 19 of 20, the other located from just beyond the stand-off | 30.4 s |

The open yard is the easiest there is: following the bearing is about all that there is to learn in it.
"""

__all__: list[str] = []
