// A mesh with the ellipsoids of its inner cover in it, which show where a section cuts it open.
#pragma once

#include "cli/render/scene_cut.hpp"

namespace prolate::cli {

class InnerScene final : public Scene {
public:
    /// The ellipsoids of `inner`, in `mesh`, which may be null. Both must outlive it.
    InnerScene(const CutScene& inner, const Scene* mesh) : inner_(inner), outside_(mesh != nullptr ? *mesh : inner) {}

    /// Of the mesh, inside which the ellipsoids lie, or without one of these.
    Hit first_hit(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const override {
        Hit hit = outside_.first_hit(origin, direction, reach);
        if (hit.id != kNothing && &outside_ == &inner_) hit.id = kInnerId;
        return hit;
    }
    bool blocked(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const override {
        return outside_.blocked(origin, direction, reach);
    }
    Place place_of(const glm::dvec3& p) const override {
        if (inner_.place_of(p).id != kNothing) return {kInnerId, 0};
        return {&outside_ == &inner_ ? kNothing : outside_.place_of(p).id, 0};
    }
    Window window(const Camera& camera) const override { return outside_.window(camera); }
    double extent(const glm::dvec3& direction) const override { return outside_.extent(direction); }

private:
    const CutScene& inner_;
    const Scene& outside_;
};

} // namespace prolate::cli
