"""From a model's file, as its maker publishes it, to what the rest works on."""
