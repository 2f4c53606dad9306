"""From cracks that were observed to the movement of the supports that may have caused them."""
