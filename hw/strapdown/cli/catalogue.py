"""The command ``strapdown list``."""

import click

from strapdown.cores import CONFIGS, MODULES, title_of

__all__ = ["list_configurations"]


@click.command("list")
def list_configurations():
    """List configurations and modules."""
    click.echo("Configurations (--config NAME):")
    for config in CONFIGS.values():
        click.echo(f"  {config.name:<16}{config.description}")
    click.echo("\nModules (--module NAME), each with the first configuration that contains it:")
    for name, (config, *_) in MODULES.items():
        click.echo(f"  {name:<14}{config.name:<16}{title_of(name, config)}")
