"""A configuration with all the files it names."""

from utank_hil.configuration.yaml_text import parse_yaml


def whole(path):
    """Content of a file with that of the files it names, so that any part can be changed."""

    def resolved(value):
        if isinstance(value, dict):
            return {key: resolved(item) for key, item in value.items()}
        if isinstance(value, list):
            return [resolved(item) for item in value]
        if isinstance(value, str) and value.endswith(".yaml"):
            return whole((path.parent / value).resolve())
        if isinstance(value, str) and value.startswith("../"):
            return str((path.parent / value).resolve())
        return value

    return resolved(parse_yaml(path.read_text())[0])
