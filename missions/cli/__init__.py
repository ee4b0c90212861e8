"""`pdpatrol`: one file a verb."""

__all__ = ["main"]


def main() -> None:
    """Entry point of `pdpatrol`: its signals are taken over before anything else is loaded."""
    from pdpatrol.missions.cli.endings.command_line import command_line

    with command_line():
        from pdpatrol.missions.cli.app import run_verb

        run_verb()
