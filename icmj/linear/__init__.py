"""The exact simulation of the linear plant: events root-found, nothing integrated by steps."""
