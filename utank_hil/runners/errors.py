"""The one error of the runners: a node raised."""


class NodeError(RuntimeError):
    """A node raised; the original exception is the `__cause__`.

    `node_name` is the node that raised, `time_ns` the time that it was handed.
    """

    def __init__(self, node_name: str, method: str, time_ns: int, cause: Exception) -> None:
        super().__init__(
            f"node '{node_name}' failed in {method}() at {time_ns * 1e-9:.6f} s: "
            f"{type(cause).__name__}: {cause}"
        )
        self.node_name = node_name
        self.time_ns = time_ns
        self._arguments = node_name, method, time_ns, cause

    def __reduce__(self) -> tuple[type["NodeError"], tuple[str, str, int, Exception]]:
        # benches run in processes of their own, and the error has to come back from there
        return NodeError, self._arguments
