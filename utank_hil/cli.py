"""Command line ``utank-hil``."""

from utank_hil.commands.loading import quietly_interruptible

with quietly_interruptible():
    import utank_hil.commands.single_thread  # noqa: F401, first: it must run before numpy loads
    from utank_hil.commands.bench import bench
    from utank_hil.commands.check import check
    from utank_hil.commands.common import new_app
    from utank_hil.commands.design import design
    from utank_hil.commands.identify import identify_log
    from utank_hil.commands.panel import panel
    from utank_hil.commands.run import run

app = new_app("Hardware-in-the-loop controller stack for active U-tube anti-roll tanks.")
app.command()(bench)
app.command()(run)
app.command()(check)
app.command()(panel)
app.command("identify")(identify_log)
app.add_typer(design, name="design")


def main() -> None:
    """Run the command line."""
    app()
