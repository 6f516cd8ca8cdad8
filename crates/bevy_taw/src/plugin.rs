use bevy::app::PluginGroupBuilder;
use bevy::ecs::schedule::{ScheduleLabel, SingleThreadedExecutor};
use bevy::prelude::*;
use bevy_transform_interpolation::TransformEasingSystems;

use crate::body::Body;
use crate::components::{
    AngularVelocity, ExternalForce, ExternalImpulse, GravityScale, HalfLength, Kinematic, Marble,
    MarbleDamping, MarbleIntegrator, MarbleMass, MarbleRotation, Sleeping, SleepingDisabled,
    SurfaceMaterial, SurfaceVelocity, Teleport, Velocity,
};
use crate::contact_force::{ContactForce, PairImpulses};
use crate::contact_points::{self, Points};
use crate::controller::MarbleController;
use crate::diagnostics::{self, StepTimes};
use crate::grounded::Grounded;
use crate::ignore::{self, ColliderDisabled, IgnoreCollisions, OneWay};
use crate::ignored::{self, IgnoredComponents};
use crate::interpolation::{self, TawInterpolationPlugin};
use crate::joint::{Joint, JointBroken};
use crate::layers::CollisionLayers;
use crate::locked_axes::LockedAxes;
use crate::pair_filter::{self, FilterPairs, FilteredPairs};
use crate::refusal::{self, InputRefused, MarbleStopped, Refusals, Told, report};
use crate::resources::{Forces, Gravity, TawModel, TawWorld};
use crate::schedule::{SchedulePlugin, TawSchedule};
use crate::snapshot::{self, RowRemoved};
use crate::spatial_query::SpatialTree;
use crate::swarm::{self, Swarm, TawSwarmModel};
use crate::touches::{self, Touches};
use crate::wall::Wall;
use crate::zones::{GravityZone, WindZone, ZoneGravity};
use crate::{
    ball_sensor, body, contact_force, controller, forget, gather, gather_bodies, gather_walls,
    grounded, joint, scatter, sensor, sleep, zones,
};

/// Everything: the physics, interpolation between its steps, and with the feature
/// `render` the gizmos, and swarms on the screen.
///
/// Leave one out with `TawPlugins.build().disable::<TawInterpolationPlugin>()`.
#[derive(Debug, Default)]
pub struct TawPlugins;

impl TawPlugins {
    /// All plugins, with the step in this schedule instead of [`FixedUpdate`]: another one of the fixed main
    /// loop, or one that the game runs. A step takes the delta of [`Time`] there; no step is made if the
    /// delta is zero.
    ///
    /// Comes before other plugins of taw, as `TawTradePlugin`: those that were added earlier are in
    /// [`FixedUpdate`], and a warning says so.
    ///
    /// Outside of the fixed main loop (the [`FixedMainScheduleOrder`] when the plugins are added), nothing is
    /// interpolated.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_taw::prelude::*;
    /// # let mut app = App::new();
    /// # app.add_plugins(MinimalPlugins);
    /// // What `FixedUpdate` moves is stepped in the same tick.
    /// app.add_plugins(TawPlugins::in_schedule(FixedPostUpdate));
    /// # app.update();
    /// ```
    ///
    /// [`FixedMainScheduleOrder`]: bevy::app::FixedMainScheduleOrder
    #[must_use]
    pub fn in_schedule(label: impl ScheduleLabel) -> PluginGroupBuilder {
        Self.build().add_before::<TawPlugin>(SchedulePlugin::new(label))
    }
}

impl PluginGroup for TawPlugins {
    fn build(self) -> PluginGroupBuilder {
        let group = PluginGroupBuilder::start::<Self>().add(TawPlugin).add(TawInterpolationPlugin);
        #[cfg(feature = "mesh")]
        let group = group.add(crate::mesh_walls::TawMeshWallsPlugin);
        #[cfg(feature = "render")]
        let group = group
            .add(crate::gizmos::TawGizmosPlugin)
            .add(crate::swarm_render::TawSwarmRenderPlugin);
        group
    }
}

/// The physics alone. Needs time to pass (Bevy's `TimePlugin`, which is in
/// `MinimalPlugins` and `DefaultPlugins`), and nothing else.
#[derive(Debug, Default)]
pub struct TawPlugin;

/// Place of the physics in a frame. The schedule of the step is [`FixedUpdate`], or another
/// [`TawSchedule`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TawSystems {
    /// In the schedule of the step: marbles with a [`MarbleController`] are driven.
    Control,
    /// In the schedule of the step: components and resources go into the world.
    Gather,
    /// In the schedule of the step: runs [`Substep`], once per substep.
    Step,
    /// In the schedule of the step: the world goes back to components and messages.
    Scatter,
    /// In [`Substep`]: the first verb.
    Integrate,
    /// In [`Substep`]: the second verb.
    GenerateContacts,
    /// In [`Substep`]: the third verb.
    Restitute,
}

/// The schedule of one substep.
///
/// A system between [`TawSystems::GenerateContacts`] and [`TawSystems::Restitute`]
/// can look at the contacts, and change them for responses other than
/// [`SoftStep`](taw::response::Response::SoftStep), which finds its own:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// # let mut app = App::new();
/// app.insert_resource(TawModel(Model { response: Response::Impulse, ..Model::GAME }));
/// // A ghost world: marbles meet walls only.
/// let ghosts = |mut world: ResMut<TawWorld>| world.contacts.mm.clear();
/// app.add_systems(
///     Substep,
///     ghosts.after(TawSystems::GenerateContacts).before(TawSystems::Restitute),
/// );
/// ```
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Substep;

/// The length of a substep, in seconds. Set before each step.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq)]
pub struct SubstepDelta(pub f32);

impl Plugin for TawPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<TawWorld>()
            .init_resource::<TawModel>()
            .init_resource::<TawSwarmModel>()
            .init_resource::<Gravity>()
            .init_resource::<Forces>()
            .init_resource::<SubstepDelta>()
            .init_resource::<StepTimes>()
            .init_resource::<gather::ChangedMarbles>()
            .init_resource::<Touches>()
            .init_resource::<PairImpulses>()
            .init_resource::<Points>()
            .init_resource::<Told>()
            .init_resource::<SpatialTree>()
            .init_resource::<ZoneGravity>()
            .init_resource::<IgnoredComponents>()
            .init_resource::<FilteredPairs>()
            .init_resource::<gather_walls::FrameTime>()
            .add_message::<InputRefused>()
            .add_message::<RowRemoved>()
            .add_message::<MarbleStopped>()
            .add_message::<JointBroken>();
        app.register_type::<(Marble, Velocity, AngularVelocity, MarbleMass, GravityScale)>()
            .register_type::<(MarbleDamping, ExternalForce, ExternalImpulse)>()
            .register_type::<(SurfaceMaterial, MarbleIntegrator, MarbleRotation, HalfLength)>()
            .register_type::<(Wall, Kinematic, Teleport, Sleeping, SleepingDisabled, CollisionLayers)>()
            .register_type::<(Grounded, ContactForce, MarbleController, GravityZone, WindZone)>()
            .register_type::<(IgnoreCollisions, ColliderDisabled, OneWay, FilterPairs, LockedAxes)>()
            .register_type::<(TawModel, TawSwarmModel, Gravity, Forces, IgnoredComponents)>()
            .register_type::<(SubstepDelta, SurfaceVelocity, Swarm, Body, Joint)>();
        diagnostics::register(app);
        sensor::register(app);
        observe(app);
        add_step(app);
        add_substep(app);
    }
}

/// Adds what watches components go, and what runs outside of the step.
fn observe(app: &mut App) {
    app.add_observer(gather::note_lost_component::<HalfLength>)
        .add_observer(gather::note_lost_component::<Velocity>)
        .add_observer(gather::note_lost_component::<AngularVelocity>)
        .add_observer(gather::note_lost_component::<MarbleMass>)
        .add_observer(gather::note_lost_component::<GravityScale>)
        .add_observer(gather::note_lost_component::<MarbleDamping>)
        .add_observer(gather::note_lost_component::<SurfaceMaterial>)
        .add_observer(gather::note_lost_component::<MarbleIntegrator>)
        .add_observer(gather::note_lost_component::<MarbleRotation>)
        .add_observer(gather::note_lost_component::<LockedAxes>)
        .add_observer(gather::note_lost_component::<SleepingDisabled>)
        .add_observer(gather::note_lost_component::<CollisionLayers>)
        .add_observer(gather::note_lost_component::<ColliderDisabled>)
        .add_observer(gather::note_lost_component::<ChildOf>)
        .add_observer(forget::forget_marble)
        .add_observer(forget::forget_wall)
        .add_observer(swarm::forget)
        .add_observer(body::forget)
        .add_observer(joint::forget);
    app.add_systems(PostUpdate, interpolation::draw_children.before(TransformSystems::Propagate));
    if TawSchedule::of(app).is_fixed(app.world()) {
        note_walls_between_steps(app);
    }
}

/// Notes where walls are before and after the fixed steps of a frame, which may be many or none. (A schedule
/// that the game runs sees where they are in each step.)
fn note_walls_between_steps(app: &mut App) {
    app.add_systems(
        RunFixedMainLoop,
        (
            gather_walls::count_frame.in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop),
            // Before something is drawn elsewhere.
            gather_walls::note_after_steps
                .after(RunFixedMainLoopSystems::FixedMainLoop)
                .before(RunFixedMainLoopSystems::AfterFixedMainLoop),
        ),
    )
    .add_systems(Part::Begin, gather_walls::note_before_steps)
    .add_systems(
        FixedFirst,
        run_part(Part::Begin)
            .after(TransformEasingSystems::UpdateStart)
            .before(TawSystems::Control),
    );
    app.edit_schedule(Part::Begin, one_by_one);
}

/// Adds the step to its schedule.
fn add_step(app: &mut App) {
    let schedule = TawSchedule::of(app).label();
    app.configure_sets(
        schedule,
        (TawSystems::Control, TawSystems::Gather, TawSystems::Step, TawSystems::Scatter)
            .chain()
            .run_if(time_passes),
    )
    .add_systems(
        schedule,
        (
            run_part(Part::Control)
                .run_if(any_with_component::<MarbleController>)
                .in_set(TawSystems::Control),
            run_part(Part::Gather).in_set(TawSystems::Gather),
            run_part(Part::Step).in_set(TawSystems::Step),
            run_part(Part::Scatter).in_set(TawSystems::Scatter),
        ),
    )
    .add_systems(Part::Control, controller::drive)
    .add_systems(Part::Step, (run_substeps, swarm::step, end_step).chain());
    add_gather(app);
    add_scatter(app);
    app.edit_schedule(Part::Control, one_by_one).edit_schedule(Part::Step, one_by_one);
}

/// Adds what goes into the world.
fn add_gather(app: &mut App) {
    app.add_systems(
        Part::Gather,
        (
            diagnostics::update_energy_audit,
            gather::settings,
            ignored::find,
            gather_walls::walls,
            ignore::count_down.run_if(any_with_component::<ColliderDisabled>),
            gather::marbles,
            (pair_filter::list, pair_filter::ask, pair_filter::report)
                .chain()
                .run_if(pair_filter::any),
            ignore::gather.run_if(ignore::any),
            gather_bodies::name.run_if(snapshot::was_restored),
            (gather_bodies::gather, gather_bodies::forces).chain().run_if(gather_bodies::any),
            joint::name.run_if(snapshot::was_restored),
            joint::gather.run_if(joint::any),
            gather::forces,
            zones::act,
            refusal::leave_out,
            swarm::gather,
            gather_walls::land,
            gather::finish,
            contact_force::are_read.pipe(contact_force::set_recording),
        )
            .chain(),
    )
    .edit_schedule(Part::Gather, one_by_one);
}

/// Adds what goes back to components and messages.
fn add_scatter(app: &mut App) {
    app.add_systems(
        Part::Scatter,
        (
            sleep::unmark,
            scatter::marbles,
            (
                body::scatter.run_if(any_with_component::<Body>),
                scatter::children,
                sleep::mark,
                joint::report_broken.run_if(any_with_component::<Joint>),
            )
                .chain(),
            refusal::report_stopped,
            swarm::report_stopped,
            (snapshot::tell_sensed, sensor::scatter, sensor::scatter_balls).chain(),
            ball_sensor::write.run_if(ball_sensor::are_read),
            ball_sensor::forget.run_if(not(ball_sensor::are_read)),
            grounded::find.run_if(any_with_component::<Grounded>),
            contact_force::finish.run_if(contact_force::are_read),
            contact_force::forget.run_if(not(contact_force::are_read)),
            contact_force::write.run_if(any_with_component::<ContactForce>),
            touches::write.run_if(touches::are_read),
            touches::forget.run_if(not(touches::are_read)),
            contact_points::write.run_if(contact_points::are_read),
            contact_points::forget.run_if(not(contact_points::are_read)),
            diagnostics::measure,
            contact_points::trigger.run_if(contact_points::are_observed),
            touches::trigger.run_if(touches::are_observed),
        )
            .chain(),
    )
    .edit_schedule(Part::Scatter, one_by_one);
}

/// Adds the verbs to the substep.
fn add_substep(app: &mut App) {
    app.configure_sets(
        Substep,
        (TawSystems::Integrate, TawSystems::GenerateContacts, TawSystems::Restitute).chain(),
    )
    .add_systems(
        Substep,
        (
            integrate.in_set(TawSystems::Integrate),
            generate_contacts.in_set(TawSystems::GenerateContacts),
            // What a game takes out of the contacts before they are restituted is not told.
            (
                touches::collect.run_if(touches::are_read),
                contact_points::collect.run_if(contact_points::are_read),
                restitute,
            )
                .chain()
                .in_set(TawSystems::Restitute),
            touches::collect_impacts.run_if(touches::are_read).after(TawSystems::Restitute),
            contact_force::collect.run_if(contact_force::are_read).after(TawSystems::Restitute),
            contact_points::collect_solved
                .run_if(contact_points::are_read)
                .after(TawSystems::Restitute),
        ),
    );
    app.edit_schedule(Substep, one_by_one);
}

/// Lets a schedule run one system after the other: threads would only have to be woken for each.
fn one_by_one(schedule: &mut Schedule) {
    schedule.set_executor(SingleThreadedExecutor::new());
}

/// Schedules of the systems of a step. Each is one exclusive system of `FixedFirst` or the step's: most of
/// them take less time than giving them to a thread would.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Part {
    Begin,
    Control,
    Gather,
    Step,
    Scatter,
}

/// Run condition: a step has a length.
pub(crate) fn time_passes(time: Res<Time>) -> bool {
    !time.delta().is_zero()
}

fn run_part(part: Part) -> impl FnMut(&mut World) {
    move |world: &mut World| {
        let _ = world.try_run_schedule(part); // the plugin has added it
    }
}

fn run_substeps(world: &mut World) {
    let substeps = world.resource::<TawWorld>().model().passes();
    let delta = world.resource::<Time>().delta_secs() / substeps as f32;
    world.resource_mut::<SubstepDelta>().0 = delta;
    // Only a substep of this very schedule could be without it.
    let _ = world.try_schedule_scope(Substep, |world, schedule| {
        for after in (0..substeps).rev() {
            world.resource_mut::<TawWorld>().begin_substep(delta * after as f32);
            schedule.run(world);
        }
    });
}

fn end_step(mut world: ResMut<TawWorld>) {
    world.end_step();
}

fn integrate(
    mut world: ResMut<TawWorld>,
    delta: Res<SubstepDelta>,
    mut times: ResMut<StepTimes>,
    mut refusals: Refusals,
) {
    let integrated = times.integrate.time(|| world.integrate(delta.0));
    world.refused = !refusals.check(None, integrated);
}

fn generate_contacts(mut world: ResMut<TawWorld>, mut times: ResMut<StepTimes>) {
    if !world.refused {
        times.generate_contacts.time(|| world.generate_contacts());
    }
}

fn restitute(mut world: ResMut<TawWorld>, delta: Res<SubstepDelta>, mut times: ResMut<StepTimes>) {
    if !world.refused {
        times.restitute.time(|| report("restitute", world.restitute(delta.0)));
    }
}
