"""The command line: commands, their options, and what they print.

Begin with `wholebody.cli.main.main`; options that commands share are in `wholebody.cli.options`.
"""
