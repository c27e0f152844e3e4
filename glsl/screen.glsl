// A probe's point, looked up in the G-buffer. Included after INTERSECT and SURFACES. The mathematics is in
// src/reference/screen.rs.

// The pixel of the band whose camera rays pass a point, given from the pivot; step_.pixel_count for none.
uint pixel_that_sees(View view, vec3 from_pivot) {
    // Distances along the view axis count from the eye, that of the pivot being 1.
    precise float depth = 1.0 + view.perspective * (dot(from_pivot, view.forward) / dot(view.forward, view.forward));
    precise float x = dot(from_pivot, view.right) / dot(view.right, view.right) / depth;
    precise float y = dot(from_pivot, view.up) / dot(view.up, view.up) / depth;
    precise float column = (0.5 + 0.5 * x) * float(view.width) - float(view.crop_x);
    precise float row = (0.5 - 0.5 * y) * float(view.height) - float(step_.first_row);
    uint rows = step_.pixel_count / view.crop_width;
    if (!(depth > 0.0 && column >= 0.0 && column < float(view.crop_width) && row >= 0.0 && row < float(rows))) {
        return step_.pixel_count;
    }
    return uint(row) * view.crop_width + uint(column);
}

// As `traverse` for the nearest hit of a camera ray: where the surface is that the pixel sees.
void look_up(View view, Ray ray, uint set) {
    hit_count = 0u;
    uint pixel = pixel_that_sees(view, (ray.base - view.pivot) + ray.offset);
    if (pixel == step_.pixel_count) return;
    Surface surface = surfaces[surface_index(pixel)];
    if (surface.triangle == MISS) return;
    Triangle triangle = triangles[surface.triangle];
    if (triangle.set != set) return;

    precise vec3 to = (surface.position - ray.base) - ray.offset;
    precise float t = dot(to, ray.direction);
    precise vec3 normal = cross(triangle.vertices[1] - triangle.vertices[0], triangle.vertices[2] - triangle.vertices[0]);
    precise float in_plane = dot(normal, to) / dot(normal, ray.direction);
    precise vec3 apart = in_plane * ray.direction - to;
    vec3 from_pivot = surface.position - view.pivot;
    precise float depth = 1.0 + view.perspective * (dot(from_pivot, view.forward) / dot(view.forward, view.forward));
    precise float width = 2.0 * length(view.right) / float(view.width) * depth * SCREEN_REACH;
    if (dot(apart, apart) <= width * width) t = in_plane;
    if (t >= ray.t_min && t <= ray.t_max) {
        hit_count = 1u;
        hit_t[0] = t;
        hit_triangle[0] = surface.triangle;
    }
}
