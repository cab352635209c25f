"""The controller on the bus: node, inbox, supervisor, monitors, commissioning, panel."""
