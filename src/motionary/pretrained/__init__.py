"""The bundle of trained systems that is installed with the package, and how it is made of a run of the pipeline.

The bundle itself lies in ``bundle/`` beside this file, with its card; :func:`motionary.load` opens it where no models
are named and none lie at hand.
"""

from motionary.pretrained.making import make_bundle

__all__ = ["make_bundle"]
