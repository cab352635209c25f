"""The nodes of the product on the bus: controller, commissioning and operator's panel."""
