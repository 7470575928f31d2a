"""Everything that reads or writes Blender: export, properties, panels, comparison, command line."""
