// libccd on two ellipsoids, by support functions of our own: its GJK, and its MPR, both of which answer only whether
// they meet.
#include "bench/peers/pairs.hpp"

#include "tests/scenes.hpp"

#include <ccd/ccd.h>

namespace prolate::bench::peers {
namespace {

struct Body {
    std::array<scenes::Point, 3> rotation; // rows
    scenes::Point radii, center;
    Body(const std::array<float, 3>& r, const Pose& pose)
        : rotation(scenes::rotation_rows(pose.rotation)), radii{r[0], r[1], r[2]}, center{pose.translation.x,
                                                                                          pose.translation.y,
                                                                                          pose.translation.z} {}
};

void support(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* point) {
    const Body& body = *static_cast<const Body*>(object);
    scenes::Point local{};
    double length = 0;
    for (size_t j = 0; j < 3; ++j) {
        for (size_t i = 0; i < 3; ++i) local[j] += body.rotation[i][j] * direction->v[i];
        local[j] *= body.radii[j], length += local[j] * local[j];
    }
    const double scale = length > 0 ? 1 / std::sqrt(length) : 0;
    for (size_t j = 0; j < 3; ++j) local[j] *= body.radii[j] * scale;
    for (size_t i = 0; i < 3; ++i)
        point->v[i] = body.center[i] + body.rotation[i][0] * local[0] + body.rotation[i][1] * local[1] +
                      body.rotation[i][2] * local[2];
}

void center(const void* object, ccd_vec3_t* point) {
    for (size_t i = 0; i < 3; ++i) point->v[i] = static_cast<const Body*>(object)->center[i];
}

using Test = int (*)(const void*, const void*, const ccd_t*);

class CcdPairs final : public PairScene {
public:
    CcdPairs(std::span<const EllipsoidPair> pairs, Test test) : test_(test) {
        for (const EllipsoidPair& p : pairs) a_.emplace_back(p.radii_a, p.a), b_.emplace_back(p.radii_b, p.b);
        CCD_INIT(&ccd_);
        ccd_.support1 = ccd_.support2 = support;
        ccd_.center1 = ccd_.center2 = center;
        ccd_.max_iterations = 500;
    }
    void meet(std::span<uint8_t> out) override {
        for (size_t i = 0; i < out.size(); ++i) out[i] = test_(&a_[i], &b_[i], &ccd_) != 0;
    }

private:
    std::vector<Body> a_, b_;
    Test test_;
    ccd_t ccd_;
};

class Ccd final : public PairLibrary {
public:
    Ccd(const char* name, Test test) : name_(name), test_(test) {}
    std::string name() const override { return name_; }
    std::string about() const override {
        return "libccd as Debian compiles it, " +
               std::string(sizeof(ccd_real_t) == sizeof(double) ? "double" : "single") + " precision";
    }
    std::unique_ptr<PairScene> place(std::span<const EllipsoidPair> pairs) const override {
        return std::make_unique<CcdPairs>(pairs, test_);
    }

private:
    const char* name_;
    Test test_;
};

} // namespace

void add_ccd(PairLibraries& libraries) {
    libraries.push_back(std::make_unique<Ccd>("libccd-gjk", ccdGJKIntersect));
    libraries.push_back(std::make_unique<Ccd>("libccd-mpr", ccdMPRIntersect));
}

} // namespace prolate::bench::peers
