"""Maps of substations as GeoJSON: read from OpenStreetMap and other sources into scenarios, and written from them."""
