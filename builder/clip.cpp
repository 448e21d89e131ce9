#include "builder/clip.hpp"

namespace prolate {

void split_polygon(const Polygon& in, int axis, double at, Polygon& below, Polygon& above) {
    below.clear();
    above.clear();
    bool any_below = false, any_above = false;
    for (const Vec& v : in) {
        any_below |= v[axis] < at;
        any_above |= v[axis] > at;
    }
    if (!any_above) below = in;
    if (!any_below) above = in;
    if (!any_above || !any_below) return;
    for (size_t i = 0; i < in.size(); ++i) {
        const Vec &p = in[i], &q = in[(i + 1) % in.size()];
        if (p[axis] <= at) below.push_back(p);
        if (p[axis] >= at) above.push_back(p);
        if ((p[axis] < at && q[axis] > at) || (p[axis] > at && q[axis] < at)) {
            // From the lower to the higher corner, so that two triangles sharing the edge get the same point.
            const bool rising = p[axis] < q[axis];
            const Vec &a = rising ? p : q, &b = rising ? q : p;
            Vec cut = a + (at - a[axis]) / (b[axis] - a[axis]) * (b - a);
            cut[axis] = at;
            below.push_back(cut);
            above.push_back(cut);
        }
    }
}

} // namespace prolate
