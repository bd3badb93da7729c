"""One codec for every contract type: JSON, msgpack frames and protobuf."""
