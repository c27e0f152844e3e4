// Which of the pixels that see something an invocation works on. Included after PIXEL.

ACTIVES(readonly);

// Position of the pixel in the band; at least step_.pixel_count for surplus invocations.
uint active_pixel() {
    uint place = pixel_index();
    if (LISTED == 0) return place;
    uint batch = sample_index() % BATCHES;
    if (place >= actives[4u * batch + 3u]) return step_.pixel_count;
    return actives[ACTIVE_HEADER + (1u + batch) * step_.pixel_count + place];
}
