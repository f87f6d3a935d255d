"""What all commands share: options, console, tables, processes, staged output."""
