// What the comparison asks of a library of collision queries: a name, how it was compiled, its own form of a model, and
// answers at given poses.
//
// All that a program would prepare once is prepared outside the timed calls: models, and the poses in the library's own
// types. What it does for each query (a result object, a request) stays inside.
#pragma once

#include "bench/peers/models.hpp"
#include "bench/peers/poses.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace prolate::bench::peers {

/// Answer to "do they meet?". `enclosed`: the surfaces do not, but a part of one solid lies inside the other, which
/// only prolate sees.
enum class Contact : uint8_t { separated, meeting, enclosed };

/// What one query looked at; empty where the library does not tell.
struct Work {
    std::optional<uint64_t> volume_tests;   ///< bounding volumes tested against each other
    std::optional<uint64_t> triangle_tests; ///< triangles tested against each other
};

/// A model in a library's own form.
class Shape {
public:
    virtual ~Shape() = default;
    virtual size_t bytes() const { return 0; } ///< memory that it holds; 0: what the heap has grown by
};

/// Two models at the poses of one sweep.
class Scene {
public:
    virtual ~Scene() = default;
    virtual Contact collide(size_t pose) = 0;
    virtual double distance(size_t) { return 0; } ///< of libraries that answer Query::distance
    virtual Work collide_work(size_t) { return {}; }
    virtual Work distance_work(size_t) { return {}; }
};

enum class Query : uint8_t {
    collide,
    distance,
    again, ///< collide, of poses that differ little from those before (Placement::before), which were asked about
    proxy, ///< collide, of covers or approximations instead of triangles
};

class Library {
public:
    virtual ~Library() = default;
    virtual std::string name() const = 0;               ///< last part of the benchmarks' names
    virtual std::string about() const = 0;              ///< version, and how it was compiled
    virtual std::string form() const { return name(); } ///< libraries of one form share shapes
    virtual bool answers(Query query) const { return query == Query::collide; }
    virtual std::unique_ptr<Shape> build(const Model& model) const = 0;
    /// `a` and `b` are of this library and outlive the scene.
    virtual std::unique_ptr<Scene> place(const Shape& a, const Shape& b, std::span<const Placement> poses) const = 0;
};

using Libraries = std::vector<std::unique_ptr<Library>>;

// One a file, each there if the library was found when this was configured.
void add_prolate(Libraries& libraries);
void add_fcl(Libraries& libraries);
void add_bullet(Libraries& libraries);
void add_ode(Libraries& libraries);

/// Libraries for Query::proxy: prolate's trees of so many leaves, and Bullet with the hulls of V-HACD, if `python` has
/// that.
Libraries proxy_libraries(uint32_t leaves, const std::string& python);
void add_prolate_proxy(Libraries& libraries, uint32_t leaves);
void add_bullet_hulls(Libraries& libraries, const std::string& python);

} // namespace prolate::bench::peers
