"""The conformance suite of `shadowbench verify`: what every method must keep to, built in or not."""
