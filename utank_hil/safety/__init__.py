"""What may be done with the pump: fault table, supervisor, monitors, alarms."""
