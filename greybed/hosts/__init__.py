"""Closures inside other engines: adapters generated from templates, built and run there."""

from greybed.hosts.model import HostModel, host_model

__all__ = ["HostModel", "host_model"]
