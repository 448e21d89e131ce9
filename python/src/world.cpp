// World: many bodies. One call at a time works on it, whatever threads call.
#include "python/src/batch.hpp"
#include "python/src/poses.hpp"
#include "python/src/tree.hpp"

#include <prolate/tbb.hpp>
#include <prolate/world_queries.hpp>

#include <mutex>
#include <unordered_map>

namespace prolate::python {
namespace {

uint64_t number_of(BodyId id) {
    return uint64_t{id.generation} << 32 | id.index;
}
BodyId id_of(uint64_t number) {
    return {.index = static_cast<uint32_t>(number), .generation = static_cast<uint32_t>(number >> 32)};
}

// The interpreter's lock is given up while it waits for the world's, and for the length of the work.
class HeldWorld {
    template <class Work> auto locked(Work&& work) {
        const nb::gil_scoped_release released;
        const std::lock_guard lock(mutex_);
        return work();
    }

public:
    explicit HeldWorld(nb::handle slack)
        : world_(value_or_throw(World::create({.slack = static_cast<float>(slack_of(slack))}))) {}

    uint64_t insert(nb::handle tree, nb::handle pose, nb::handle margin, nb::handle layers, nb::handle mask,
                    nb::handle order) {
        const HeldTree& held = tree_of(tree, "tree");
        const Poses poses(pose, "pose", order);
        if (!poses.single()) value_error("pose", "must be one pose");
        const RoundedPose at = rounded(poses, 0, held.reach);
        const Body body{.shape = held.view,
                        .pose = at.pose,
                        .layers = static_cast<uint32_t>(whole(layers, "layers", 0, UINT32_MAX)),
                        .mask = static_cast<uint32_t>(whole(mask, "mask", 0, UINT32_MAX)),
                        .margin = rounded_up(number_from_0(margin, "margin") + at.slack)};
        const uint64_t id = number_of(value_or_throw(locked([&] { return world_.insert(body); })));
        trees_.emplace(id, nb::borrow(tree));
        return id;
    }
    void remove(nb::handle id) {
        const uint64_t number = whole(id, "id", 0, UINT64_MAX);
        check_done(locked([&] { return world_.remove(id_of(number)); }), "id " + std::to_string(number));
        gone_.push_back(std::move(trees_[number])); // pairs name the body until they are updated
        trees_.erase(number);
    }
    void move(nb::handle ids, nb::handle poses_, nb::handle order) {
        const std::vector<BodyId> bodies = ids_of(ids);
        const Poses poses(poses_, "poses", order);
        if (poses.count() != bodies.size()) value_error("poses", "must be as many as ids");
        std::vector<Pose> to(bodies.size());
        for (size_t i = 0; i < to.size(); ++i) to[i] = rounded(poses, i, 0).pose;
        const auto moved = locked([&] { return world_.move(bodies, to); });
        if (!moved) throw Failure{moved.error(), "ids[" + std::to_string(moved.error().where) + "]"};
    }
    /// (ids (M, 2), begins (M,))
    nb::tuple pairs() {
        update();
        const auto pairs = world_.pairs();
        auto ids = new_array<uint64_t>(2 * pairs.size());
        auto begins = new_array<bool>(pairs.size());
        for (size_t i = 0; i < pairs.size(); ++i) {
            ids[2 * i] = number_of(pairs[i].a), ids[2 * i + 1] = number_of(pairs[i].b);
            begins[i] = pairs[i].begins;
        }
        return nb::make_tuple(to_numpy(std::move(ids), {pairs.size(), 2}), to_numpy(std::move(begins), {pairs.size()}));
    }
    /// (ids (M, 2), verdicts (M,))
    nb::tuple collide(nb::handle margin, nb::handle threads) {
        const QueryOptions options{.margin = rounded_up(number_from_0(margin, "margin"))};
        const int workers = thread_count(threads);
        update();
        std::vector<CollideResult> results;
        std::vector<uint64_t> ids;
        check_done(locked([&] {
            const auto pairs = world_.pairs();
            results.resize(pairs.size());
            for (const BodyPair& pair : pairs) ids.push_back(number_of(pair.a)), ids.push_back(number_of(pair.b));
            oneapi::tbb::task_arena arena(workers);
            const Jobs jobs = workers > 1 ? tbb_jobs(arena) : Jobs{};
            const std::unique_ptr<QueryContext[]> contexts(new QueryContext[jobs.workers]);
            return prolate::collide(world_, pairs, std::span(results), {{contexts.get(), jobs.workers}, jobs}, options);
        }));
        auto verdicts = new_array<uint8_t>(results.size());
        for (size_t i = 0; i < results.size(); ++i) verdicts[i] = static_cast<uint8_t>(results[i].verdict);
        return nb::make_tuple(to_numpy(ids, {results.size(), 2}), to_numpy(std::move(verdicts), {results.size()}));
    }
    uint32_t count() {
        return locked([&] { return world_.body_count(); });
    }

private:
    static double slack_of(nb::handle slack) {
        const double value = number_from_0(slack, "slack");
        if (value > 1) value_error("slack", "must be 0 to 1");
        return value;
    }
    static RoundedPose rounded(const Poses& poses, size_t i, double reach) {
        if (poses.floats()) return {poses.floats()[i], 0};
        return in_frame({}, poses.at(i), reach);
    }
    static std::vector<BodyId> ids_of(nb::handle ids) {
        const nb::object array = as_numpy(ids, "ids", "uint64");
        const AnyArray view = import_array(array);
        if (view.ndim() != 1) value_error("ids", "must have shape (N,), not " + view.shape_text());
        std::vector<BodyId> out;
        for (size_t i = 0; i < view.shape(0); ++i) out.push_back(id_of(static_cast<const uint64_t*>(view.data())[i]));
        return out;
    }
    void update() {
        const auto updated = locked([&]() -> Result<void> {
            const auto pairs = world_.update_pairs();
            if (!pairs) return pairs.error();
            return {};
        });
        check_done(updated);
        gone_.clear();
    }

    World world_;
    std::mutex mutex_;
    std::unordered_map<uint64_t, nb::object> trees_; ///< by the number of the body that they are of
    std::vector<nb::object> gone_;
};

} // namespace

void bind_world(nb::module_& m) {
    nb::class_<HeldWorld>(m, "World")
        .def(nb::init<nb::handle>(), nb::arg("slack").none())
        .def("insert", &HeldWorld::insert, nb::arg("tree").none(), nb::arg("pose").none(), nb::arg("margin").none(),
             nb::arg("layers").none(), nb::arg("mask").none(), nb::arg("order").none())
        .def("remove", &HeldWorld::remove, nb::arg("id").none())
        .def("move", &HeldWorld::move, nb::arg("ids").none(), nb::arg("poses").none(), nb::arg("order").none())
        .def("pairs", &HeldWorld::pairs)
        .def("collide", &HeldWorld::collide, nb::arg("margin").none(), nb::arg("threads").none())
        .def("__len__", &HeldWorld::count);
}

} // namespace prolate::python
