//! What every store promises. Each clause is a plain function of a fresh store; times are explicit seconds.
//!
//! The stores of this suite hold [`LIMITS`].

mod calls;
mod constraints;
mod endings;
mod keys;
mod leases;
mod looking;
mod maps;
pub(crate) mod prelude;
mod sessions;
mod upkeep;

use std::sync::Arc;
use std::time::Duration;

use mapweld::store::{QueueLimits, Store};

pub(crate) use calls::*;
pub(crate) use constraints::*;
pub(crate) use endings::*;
pub(crate) use keys::*;
pub(crate) use leases::*;
pub(crate) use looking::*;
pub(crate) use maps::*;
pub(crate) use sessions::*;
pub(crate) use upkeep::*;

/// Small enough to be met.
pub(crate) const LIMITS: QueueLimits = QueueLimits {
    per_session: 3,
    total: 5,
    max_attempts: 3,
};

/// How long the leases of this suite last.
pub(crate) const LEASE: Duration = Duration::from_secs(30);

/// A test of every clause, each on a store of its own that `$fresh` makes: `async fn() -> Option<(impl Store, impl Any)>`;
/// nothing where this machine lacks what the store needs.
macro_rules! contract {
    ($fresh:path) => {
        contract!(@ $fresh,
            making_a_session_again_with_the_same_settings_answers_the_one_that_is_there,
            making_a_session_again_with_other_settings_is_refused,
            a_session_that_is_not_there_is_not_found_by_any_door,
            a_patch_changes_what_it_names_and_when_the_session_changed,
            sessions_are_listed_by_name_page_after_page,
            names_are_ordered_byte_by_byte_whatever_the_database_thinks_of_hyphens,
            a_deleted_session_takes_everything_with_it_and_its_runner_loses_the_lease,
            a_map_is_read_back_as_it_was_added,
            a_map_of_an_unknown_session_makes_it_only_when_asked_to,
            the_first_robot_to_push_becomes_the_anchor_unless_one_was_named,
            the_same_content_from_the_same_robot_again_is_the_same_map_and_causes_no_job,
            the_same_content_from_another_robot_is_another_map,
            the_newest_map_of_each_robot_is_the_one_of_its_highest_sequence,
            maps_are_listed_newest_first_page_after_page_and_by_robot,
            uploads_while_a_job_waits_share_it,
            uploads_while_a_job_runs_cause_exactly_one_more,
            a_session_that_does_not_merge_by_itself_gets_no_job,
            a_full_queue_of_a_session_refuses_the_job_and_the_map_that_needs_it,
            a_full_queue_of_the_service_refuses_too,
            an_upload_that_joins_a_waiting_job_needs_no_room_in_the_queue,
            nothing_to_do_is_no_claim,
            a_job_is_not_claimed_before_it_is_due_and_the_longest_due_comes_first,
            a_claimed_job_is_not_claimed_again_while_its_lease_holds,
            jobs_of_one_session_run_one_after_the_other,
            an_expired_lease_is_claimed_again_with_a_greater_token,
            a_renewed_lease_does_not_expire,
            a_renewal_tells_progress_and_the_wish_to_cancel,
            a_zombie_whose_job_was_claimed_again_can_write_nothing,
            a_lease_that_expired_but_was_not_claimed_again_still_publishes,
            publishing_makes_the_version_and_ends_the_job_in_one_step,
            versions_count_from_one_without_gaps_and_name_their_parent,
            a_version_is_read_back_as_it_was_published,
            a_dry_run_ends_with_its_result_and_no_version,
            a_failed_attempt_waits_for_its_pause_and_runs_again,
            a_job_that_would_fail_again_is_failed_at_once,
            a_job_out_of_attempts_is_failed_with_the_last_reason,
            a_poison_job_that_takes_its_workers_with_it_is_parked_with_a_reason,
            a_released_job_is_due_at_once_and_its_attempt_does_not_count,
            a_job_that_goes_back_to_the_queue_leaves_the_key_to_the_one_that_came_meanwhile,
            cancelling_ends_a_waiting_job_and_asks_a_running_one,
            a_cancelled_runner_ends_as_cancelled_however_it_leaves,
            a_job_whose_worker_was_lost_after_a_cancel_is_cancelled_not_run_again,
            an_ended_job_stays_as_it_is,
            a_key_is_found_by_its_id_as_it_was_made,
            a_key_that_is_not_there_is_not_found_and_not_revoked,
            keys_are_listed_oldest_first_page_after_page,
            a_revoked_key_is_kept_and_stays_revoked_since_the_first_time,
            a_store_has_keys_from_the_first_one_on_also_when_all_are_revoked,
            a_named_change_takes_effect_once_and_its_answer_is_given_again,
            a_name_stands_for_one_request_while_it_is_under_way_and_after,
            names_are_each_owners_own,
            an_attempt_that_was_lost_is_followed_by_one_that_makes_the_same,
            a_refused_change_gives_its_name_back_and_an_unsure_one_keeps_its_id,
            a_name_is_free_again_when_it_has_expired_swept_or_not,
            of_many_that_come_at_once_under_one_name_one_takes_effect,
            a_job_or_a_constraint_that_is_made_again_is_the_one_that_is_there,
            jobs_are_listed_newest_first,
            the_depth_of_the_queue_counts_waiting_and_running_jobs,
            a_constraint_stands_until_it_is_removed,
            constraints_that_cannot_hold_at_once_are_refused_and_change_nothing,
            a_session_has_a_limited_number_of_constraints,
            constraints_go_with_their_session,
            a_version_that_repeats_an_earlier_one_says_which,
            a_version_that_moves_the_anchor_moves_that_of_its_session_in_one_step,
            sessions_are_found_by_their_labels,
            old_versions_go_with_the_maps_that_only_they_were_made_of,
            maps_that_a_merge_may_still_take_stay,
            ended_jobs_go_when_they_are_old_unless_their_version_is_kept,
            only_blobs_that_no_record_names_are_marked,
            a_record_that_names_a_marked_blob_is_refused_whole,
            a_mark_is_taken_away_only_by_who_saw_it_as_it_is,
            marks_and_records_never_meet_halfway,
            changes_are_announced_to_those_who_listen,
            many_tasks_that_claim_at_once_get_each_job_once,
            many_sessions_and_workers_publish_without_gaps_or_doubles,
            many_uploads_at_once_keep_sequences_without_gaps_and_share_jobs,
        );
    };
    (@ $fresh:path, $($clause:ident,)*) => {
        $(
            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $clause() {
                let Some((store, _keep)) = $fresh().await else { return };
                $crate::store_contract::$clause(std::sync::Arc::new(store)).await;
            }
        )*
    };
}
pub(crate) use contract;

pub(crate) type AnyStore = Arc<dyn Store>;
