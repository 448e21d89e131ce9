// ODE's triangle meshes: OPCODE's trees of axis-parallel boxes. ODE has no query that stops at the first contact
// either; asked for a single one, it still looks at all pairs of triangles that may meet.
#include "bench/peers/library.hpp"

#include <ode/ode.h>

namespace prolate::bench::peers {
namespace {

void initialise() { // once for the process; the libraries outlive every shape
    static const bool done = [] {
        dInitODE2(0);
        dAllocateODEDataForThread(dAllocateMaskAll);
        return true;
    }();
    static_cast<void>(done);
}

struct OdePose {
    dVector3 translation;
    dQuaternion rotation; // w, x, y, z
};

OdePose placed(const Pose& pose) {
    const Quat& q = pose.rotation;
    OdePose out{{pose.translation.x, pose.translation.y, pose.translation.z, 0}, {q.w, q.x, q.y, q.z}};
    dNormalize4(out.rotation);
    return out;
}

class OdeShape final : public Shape {
public:
    explicit OdeShape(const Model& model) : mesh_(model.mesh) {
        data_ = dGeomTriMeshDataCreate();
        dGeomTriMeshDataBuildSingle(data_, mesh_.vertices.data(), sizeof(Vec3), static_cast<int>(mesh_.vertices.size()),
                                    mesh_.triangles.data(), static_cast<int>(3 * mesh_.triangles.size()),
                                    sizeof(Triangle));
    }
    OdeShape(const OdeShape&) = delete;
    ~OdeShape() override { dGeomTriMeshDataDestroy(data_); }
    dTriMeshDataID data() const { return data_; }

private:
    Mesh mesh_; // which ODE borrows
    dTriMeshDataID data_;
};

class OdeScene final : public Scene {
public:
    OdeScene(const OdeShape& a, const OdeShape& b, std::span<const Placement> poses)
        : a_(dCreateTriMesh(nullptr, a.data(), nullptr, nullptr, nullptr)),
          b_(dCreateTriMesh(nullptr, b.data(), nullptr, nullptr, nullptr)) {
        for (const Placement& p : poses) a_at_.push_back(placed(p.a)), b_at_.push_back(placed(p.b));
    }
    OdeScene(const OdeScene&) = delete;
    ~OdeScene() override { dGeomDestroy(a_), dGeomDestroy(b_); }
    Contact collide(size_t i) override {
        move(a_, a_at_[i]), move(b_, b_at_[i]);
        dContactGeom contact;
        return dCollide(a_, b_, 1, &contact, sizeof contact) > 0 ? Contact::meeting : Contact::separated;
    }

private:
    static void move(dGeomID body, const OdePose& to) {
        dGeomSetPosition(body, to.translation[0], to.translation[1], to.translation[2]);
        dGeomSetQuaternion(body, to.rotation);
    }
    dGeomID a_, b_;
    std::vector<OdePose> a_at_, b_at_;
};

class Ode final : public Library {
public:
    std::string name() const override { return "ode-trimesh"; }
    std::string about() const override {
        return "ODE " PROLATE_BENCH_ODE_VERSION " as Debian compiles it (-O2, SSE2), " +
               std::string(sizeof(dReal) == sizeof(double) ? "double" : "single") + " precision, at most one contact";
    }
    std::unique_ptr<Shape> build(const Model& model) const override {
        initialise();
        return std::make_unique<OdeShape>(model);
    }
    std::unique_ptr<Scene> place(const Shape& a, const Shape& b, std::span<const Placement> poses) const override {
        return std::make_unique<OdeScene>(static_cast<const OdeShape&>(a), static_cast<const OdeShape&>(b), poses);
    }
};

} // namespace

void add_ode(Libraries& libraries) {
    libraries.push_back(std::make_unique<Ode>());
}

} // namespace prolate::bench::peers
