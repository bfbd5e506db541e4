"""What is timed, and with what: a fixed workload that every version of the software and every peer can be given."""
