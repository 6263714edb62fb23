"""The version: here and nowhere else; the build reads it from here."""

VERSION = "0.1.0"
