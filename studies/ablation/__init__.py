"""What each rule of the diagnosis earns: every rule neutralised in turn on kept cases."""
