"""The script worker without its lint, so that only the jail stands between a payload and the machine."""

from gap_cli.sandbox import script_child

script_child.report = lambda *arguments: None
main = script_child.main
